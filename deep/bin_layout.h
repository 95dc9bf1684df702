// The bins of each pixel, before anything is known of them but where they lie.
#pragma once

#include <algorithm>
#include <cfloat>
#include <optional>
#include <span>

#include "deep/image.h"
#include "deep/volume.h"

namespace fathom::deep {

// Where a sample or a bin lies among bins: its Z, a volume's middle; finite, what is no number or infinite at the far
// end.
inline float binDepth(float z, float zBack) {
  return std::clamp(float(usableRange(z, zBack).middle()), -FLT_MAX, FLT_MAX);
}

// The number of the bin that lies nearest to `depth`; of two as near the front one. `bins` ascends and is not empty.
size_t nearestBin(std::span<const float> bins, float depth);

struct BinLayout {
  Box window;
  Buffer<uint64_t> offsets;  // window.area() + 1, as in a DeepImage
  Buffer<float> depth;       // of each bin, ascending within a pixel
  Buffer<float> alpha;       // of each bin, as `over` takes it; empty: as many camera samples as it gets

  // The pixel's first bin and the one after its last.
  struct Span {
    size_t begin = 0, end = 0;
    size_t size() const { return end - begin; }
  };
  Span at(int x, int y) const {
    if (!window.contains(x, y)) return {};
    const size_t pixel = window.index(x, y);
    return {size_t(offsets[pixel]), size_t(offsets[pixel + 1])};
  }
};

struct ClusterParams {
  double E = 2;  // how fast the threshold grows from bin to bin: section 5.1 of the paper
  double first =
      1;  // the threshold of a pixel's bin b = 1, 2, ... is (b + first)^E pixel widths; 1: figure 10, 0: section 5.1
};

// Bins where samples lie close to each other in depth: appendix A. `ppuScale` is the size in pixels of a one-unit quad
// one unit from the camera. A bin's depth is the mean of its samples' depths. Samples may lie in any order. Throws
// Error without Z.
BinLayout findBins(const DeepImage& samples, float ppuScale, const ClusterParams& params = {});

// The bins of a depth prepass (section 5.1): the depths of its samples, and their alphas where it has a channel A.
BinLayout layoutFrom(const DeepImage& prepass);

}  // namespace fathom::deep
