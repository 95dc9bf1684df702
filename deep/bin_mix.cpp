#include "deep/bin_mix.h"

#include "deep/bin_neighbours.h"
#include "deep/still.h"
#include "flat/finite.h"
#include "flat/mix_kernel.h"

namespace fathom::deep {

namespace {

// Bins have fewer alike neighbours than pixels, and the filter's errors differ more: 5 gives a hundredth less error than
// 1 or 20.
constexpr float kStrength = 5;

flat::MixSample sampleOf(const GateBin& bin, const float* second) {
  flat::MixSample sample = {};
  const bool other = isFinite(second[0]) && isFinite(second[1]) && isFinite(second[2]);
  sample.samples = bin.samples;
  for (size_t c = 0; c < 3; ++c) {
    const float b = other ? second[c] : bin.filtered[c];
    sample.mean[c] = 0.5f * (bin.filtered[c] + b);
    sample.difference[c] = bin.filtered[c] - b;
    sample.residual[c] = bin.residual[c] + sample.difference[c];
    sample.variance[c] = bin.variance[c];
  }
  return sample;
}

}  // namespace

void mixBins(const DenoiseData& data, std::span<const float> second, const Buffer<uint8_t>& still, float level,
             float prior, Buffer<GateBin>& bins) {
  const Buffer<uint8_t> unread = allWithin(still, data.width, data.height, 2 * flat::kNeighbourRadius);
  Buffer<flat::MixSample> samples(data.bins());
  forActiveBins(data, unread,
                [&](int) { return [&](int, size_t b) { samples[b] = sampleOf(bins[b], second.data() + 3 * b); }; });
  const float floor = flat::kAlikeFloor * level * level;
  const flat::Reach reach;
  const flat::MixParams params{.prior = prior, .strength = kStrength};
  forActiveBins(data, still, [&](int y) {
    return [&, y](int x, size_t b) {
      flat::MixNeighbours neighbours;
      forBinNeighbours(data, reach, x, y, b, [&](size_t d, float weight) {
        if (samples[d].samples > 0) neighbours.add(samples[d], weight);
      });
      const float back = 1 - flat::mixShare(samples[b], neighbours, params, floor);
      for (size_t c = 0; c < 3; ++c) {
        bins[b].filtered[c] -= back * samples[b].difference[c];
        bins[b].residual[c] += back * samples[b].difference[c];
      }
    };
  });
}

}  // namespace fathom::deep
