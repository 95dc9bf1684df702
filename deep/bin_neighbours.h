// The neighbours of a bin: in each pixel around the bin nearest in depth, if within 2 %.
#pragma once

#include <cmath>

#include "base/parallel.h"
#include "deep/denoise_data.h"
#include "flat/neighbourhood.h"

namespace fathom::deep {

inline constexpr float kSameDepth = 0.02f;  // |log z - log z'| of neighbours

// The bin of [begin, end) nearest to depth z (the last of those as near), or `end` where none is near enough.
inline size_t nearestBin(const float* depth, size_t begin, size_t end, float z) {
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

// Calls body(neighbour, reach) for the neighbours of a bin of pixel (x, y), itself among them.
template <class Body>
void forBinNeighbours(const DenoiseData& data, const flat::Reach& reach, int x, int y, size_t bin, const Body& body) {
  const float* depth = data.depth.value[0].data();
  flat::forNeighbours(data.width, data.height, x, y, [&](int xq, int yq) {
    const uint64_t* offsets = data.offsets + size_t(yq) * size_t(data.width) + size_t(xq);
    const size_t end = size_t(offsets[1]);
    const size_t d = nearestBin(depth, size_t(offsets[0]), end, depth[bin]);
    if (d != end) body(d, reach(xq - x, yq - y));
  });
}

// Calls row(y) for the rows in parallel; what it returns is called on (x, bin) for the bins of its pixels but those
// with skip[pixel] != 0: a place for scratch of the row's own.
template <class Row>
void forActiveBins(const DenoiseData& data, const Buffer<uint8_t>& skip, const Row& row) {
  parallelFor(0, data.height, [&](int y) {
    auto body = row(y);
    for (int x = 0; x < data.width; ++x) {
      const size_t pixel = size_t(y) * size_t(data.width) + size_t(x);
      for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]) && !skip[pixel]; ++b) body(x, b);
    }
  });
}

}  // namespace fathom::deep
