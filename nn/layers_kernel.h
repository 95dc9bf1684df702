// The inner loops of the layered denoiser: sums over samples, kernels that splat, and what is made of them.
//
// Source: Munkberg and Hasselgren, "Neural Denoising with Layer Embeddings", equations 2 to 4 and appendix A, with the
// departures that nn/layers.h names.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/buffer.h"
#include "nn/planes.h"

namespace fathom::nn {

// What a layer's kernels splat, and what comes out of them.
constexpr size_t kSplatted = 6;     // R, G, B, weight, occupancy, depth, each times the weight but for the occupancy
constexpr size_t kLayerPlanes = 5;  // R, G, B (premultiplied), alpha, depth times alpha
// Behind both where light is divided, times weight or alpha: R, G, B of what by, and of the light before.
constexpr size_t kDivision = 6;
constexpr size_t kMostSplatted = kSplatted + kDivision;

// Planes whose rows have zeros on both sides, and room for whole vectors on the right. Keeps its memory.
class WidePlanes {
 public:
  static constexpr int kBorder = 2;

  void resize(size_t count, int height, int width);
  int height() const { return height_; }
  int width() const { return width_; }
  ptrdiff_t stride() const { return stride_; }
  float* row(size_t plane, int y) { return values_.data() + (ptrdiff_t(plane) * height_ + y) * stride_ + kBorder; }
  const float* row(size_t plane, int y) const { return const_cast<WidePlanes*>(this)->row(plane, y); }
  Planes planes(size_t count);
  ConstPlanes planes(size_t count) const;
  // Zeros beside the rows, after they were written.
  void clearBorders();

 private:
  int height_ = 0, width_ = 0;
  ptrdiff_t stride_ = 0;
  Buffer<float> values_;
};

// sums[g][pixel[i]][0..block) += weight[i] * values[g][i][0..block), for i below `count` in their order. `stride`: floats
// between the groups of values; `sumStride`: of the sums. Samples of weight 0 are passed over.
void addWeighted(const float* values, size_t stride, int groups, int block, const float* weight, const uint32_t* pixel,
                 size_t count, float* sums, size_t sumStride);

// logits: [count][block] of which the first kMostLayers mean something. shares[l][i], `stride` floats apart, becomes the
// part of sample i in layer l, of `layers` (2 or 4): a softmax, less 0.01, at least 0, and brought back to a sum of 1.
// Room for whole vectors after each row.
void layerShares(const float* logits, int block, size_t count, int layers, float* shares, size_t stride);

// [groups][height][width][block] (sides even) to the mean of 2x2 pixels.
void halveGroups(const float* from, int groups, int height, int width, int block, float* to);

// Splats `values` (kSplatted planes with clear borders, kMostSplatted if `divided`) with kernels exp(clamp(logit, -12,
// 12)) of 5x5 taps, row-major from (-2, -2): what pixel q gives to q + d is weighed by tap d of q. Pixels beyond the
// borders do not exist. `result` gets kLayerPlanes planes (and kDivision): sums of colours, weights, depths (and the
// others) over those of occupancies; alpha at most 1. `logits`: [groups][height][width][block]; for `shares` that are given, three
// more channels, whose softmax becomes its planes.
void splat(const float* logits, int block, const WidePlanes& values, bool divided, WidePlanes& result,
           WidePlanes* shares);

// to = a * b, for one row of `a` and each of `count` planes of `b`; all as wide.
void scaleRows(const WidePlanes& factor, const WidePlanes& from, size_t count, WidePlanes& to);

}  // namespace fathom::nn
