// Source: Vicini et al., "Denoising Deep Monte Carlo Renderings", section 5.1 and appendix A.
// Departures: figure 10 adds the gap *behind* a sample before it decides about that sample, so that each new bin starts
// one sample early and every gap leaves a bin of one sample; here the gap before the sample decides. The paper leaves
// open what a bin's depth is; here it is the mean of its samples.
#include "deep/bin_layout.h"

#include <cmath>
#include <numeric>
#include <vector>

#include "base/parallel.h"

namespace fathom::deep {

namespace {

// How far a gap in depth reaches on the image plane, in pixels, at the distance of its near end.
double gapOnScreen(float near, float far, float ppuScale) {
  return (double(far) - double(near)) * (double(ppuScale) / std::max(double(near), double(FLT_MIN)));
}

float meanOf(std::span<const float> depths) {
  double sum = 0;
  for (const float z : depths) sum += double(z);
  return float(sum / double(depths.size()));
}

// Appends the bins of one pixel; `depths` ascend.
void appendBins(std::span<const float> depths, float ppuScale, const ClusterParams& params, std::vector<float>& bins) {
  const auto threshold = [&](int bin) { return std::pow(bin + params.first, params.E); };
  int bin = 1;
  size_t start = 0;
  double sum = 0;
  for (size_t k = 1; k < depths.size(); ++k) {
    sum += gapOnScreen(depths[k - 1], depths[k], ppuScale);
    if (!(sum > threshold(bin))) continue;
    bins.push_back(meanOf(depths.subspan(start, k - start)));
    start = k;
    sum = 0;
    ++bin;
  }
  if (!depths.empty()) bins.push_back(meanOf(depths.subspan(start)));
}

}  // namespace

size_t nearestBin(std::span<const float> bins, float depth) {
  const size_t behind = size_t(std::lower_bound(bins.begin(), bins.end(), depth) - bins.begin());
  if (behind == 0) return 0;
  const size_t before = behind - 1;
  if (behind == bins.size()) return before;
  return double(depth) - double(bins[before]) <= double(bins[behind]) - double(depth) ? before : behind;
}

BinLayout findBins(const DeepImage& samples, float ppuScale, const ClusterParams& params) {
  const std::span<const float> z = samples.get("Z"), zBack = samples.tryGet("ZBack");
  BinLayout layout{samples.dataWindow, Buffer<uint64_t>(samples.pixels() + 1, 0), {}, {}};
  const size_t width = size_t(samples.dataWindow.width());
  std::vector<std::vector<float>> rows(size_t(samples.dataWindow.height()));
  parallelFor(0, samples.dataWindow.height(), [&](int y) {
    std::vector<float> depths;
    std::vector<float>& bins = rows[size_t(y)];
    for (size_t pixel = size_t(y) * width; pixel < size_t(y + 1) * width; ++pixel) {
      depths.clear();
      for (size_t i = samples.offsets[pixel]; i < samples.offsets[pixel + 1]; ++i)
        depths.push_back(binDepth(z[i], zBack.empty() ? z[i] : zBack[i]));
      std::sort(depths.begin(), depths.end());
      const size_t before = bins.size();
      appendBins(depths, ppuScale, params, bins);
      layout.offsets[pixel + 1] = bins.size() - before;
    }
  });
  for (size_t i = 0; i < samples.pixels(); ++i) layout.offsets[i + 1] += layout.offsets[i];
  layout.depth = Buffer<float>(layout.offsets[samples.pixels()]);
  float* out = layout.depth.data();
  for (const std::vector<float>& bins : rows) out = std::copy(bins.begin(), bins.end(), out);
  return layout;
}

BinLayout layoutFrom(const DeepImage& prepass) {
  const std::span<const float> z = prepass.get("Z"), zBack = prepass.tryGet("ZBack"), alpha = prepass.tryGet("A");
  BinLayout layout{prepass.dataWindow, prepass.offsets.copy(), Buffer<float>(prepass.samples()),
                   Buffer<float>(alpha.empty() ? 0 : prepass.samples())};
  std::vector<size_t> order;
  for (size_t pixel = 0; pixel < prepass.pixels(); ++pixel) {
    const size_t first = prepass.offsets[pixel];
    const auto depthOf = [&](size_t i) { return binDepth(z[i], zBack.empty() ? z[i] : zBack[i]); };
    order.resize(prepass.count(pixel));
    std::iota(order.begin(), order.end(), first);
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return depthOf(a) < depthOf(b); });
    for (size_t i = 0; i < order.size(); ++i) {
      layout.depth[first + i] = depthOf(order[i]);
      if (!alpha.empty()) layout.alpha[first + i] = float(opacity(alpha[order[i]]));
    }
  }
  return layout;
}

}  // namespace fathom::deep
