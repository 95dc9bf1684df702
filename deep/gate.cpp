#include "deep/gate.h"

#include <cmath>

#include "flat/parallel.h"

namespace fathom::deep {
namespace {

constexpr float kSameDepth = 0.02f;  // |log z - log z'| of neighbours
constexpr float kReach = 5;          // exp(-|offset|^2 / kReach)
constexpr float kThreshold = 2;      // variances of the mean residual that are noise
constexpr float kFloor = 4e-4f;      // of the squared mean colour: 1e-4 where that is 0.5

// The bin of [begin, end) nearest to depth z, or `end` where none is near enough.
size_t nearest(const float* depth, size_t begin, size_t end, float z) {
  size_t best = end;
  float least = kSameDepth;
  for (size_t d = begin; d < end; ++d) {
    const float e = std::fabs(depth[d] - z);
    if (e <= least) {
      least = e;
      best = d;
    }
  }
  return best;
}

void findNeighbours(const DenoiseData& data, const Buffer<GateBin>& bins, int x, int y, size_t bin,
                    const std::array<float, 2 * kGateRadius + 1>& reach, flat::GateNeighbours& result) {
  const float* depth = data.depth.value[0].data();
  const int x0 = std::max(0, x - kGateRadius), x1 = std::min(data.width - 1, x + kGateRadius);
  result.count = 0;
  for (int yq = std::max(0, y - kGateRadius); yq <= std::min(data.height - 1, y + kGateRadius); ++yq) {
    const uint64_t* offsets = data.offsets + size_t(yq) * size_t(data.width);
    for (int xq = x0; xq <= x1; ++xq) {
      const size_t end = size_t(offsets[xq + 1]);
      const size_t d = nearest(depth, size_t(offsets[xq]), end, depth[bin]);
      if (d == end || !(bins[d].samples > 0)) continue;
      result.add(bins[d], reach[size_t(yq - y + kGateRadius)] * reach[size_t(xq - x + kGateRadius)]);
    }
  }
}

}  // namespace

Buffer<float> gate(const DenoiseData& data, const Buffer<GateBin>& bins, const Buffer<uint8_t>& still, float level) {
  Buffer<float> result(data.bins(), 0.0f);
  const float floor = kFloor * level * level;
  std::array<float, 2 * kGateRadius + 1> reach;
  for (int i = -kGateRadius; i <= kGateRadius; ++i) reach[size_t(i + kGateRadius)] = std::exp(-float(i * i) / kReach);
  parallelFor(0, data.height, [&](int y) {
    flat::GateNeighbours neighbours;
    for (int x = 0; x < data.width; ++x) {
      const size_t pixel = size_t(y) * size_t(data.width) + size_t(x);
      if (still[pixel]) continue;
      for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b) {
        if (!(bins[b].samples > 0)) continue;
        findNeighbours(data, bins, x, y, b, reach, neighbours);
        result[b] = flat::takenBack(bins[b], neighbours, kThreshold, floor);
      }
    }
  });
  return result;
}

}  // namespace fathom::deep
