#include "deep/gate.h"

#include "deep/bin_neighbours.h"

namespace fathom::deep {

namespace {

constexpr float kThreshold = 2;  // variances of the mean residual that are noise

}  // namespace

Buffer<flat::GateVerdict> gate(const DenoiseData& data, const Buffer<GateBin>& bins, const Buffer<uint8_t>& still,
                               float level) {
  Buffer<flat::GateVerdict> result(data.bins(), {});
  const float floor = flat::kAlikeFloor * level * level;
  const flat::Reach reach;
  forActiveBins(data, still, [&](int y) {
    return [&, y, neighbours = flat::GateNeighbours()](int x, size_t b) mutable {
      if (!(bins[b].samples > 0)) return;
      neighbours.count = 0;
      forBinNeighbours(data, reach, x, y, b, [&](size_t d, float weight) {
        if (bins[d].samples > 0) neighbours.add(bins[d], weight);
      });
      result[b] = flat::takenBack(bins[b], neighbours, kThreshold, floor);
    };
  });
  return result;
}

}  // namespace fathom::deep
