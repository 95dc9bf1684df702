// Filtering with kernels that a network predicts, at several scales.
//
// Source: the multi-scale form of kernel-predicting networks, o = i - a U D i + a U i_coarse, with D the mean of 2x2
// pixels and U bilinear enlargement; kernels are softmax over 5x5 logits, and gather with coordinates clamped to the image.
#pragma once

#include <cstddef>

#include "base/buffer.h"
#include "nn/planes.h"

namespace fathom::nn {

constexpr int kKernelWidth = 5;
constexpr int kKernelTaps = kKernelWidth * kKernelWidth;

// Three planes with their outermost values repeated around them, and room for whole vectors on the right. Keeps its
// memory when its size changes.
class BorderedColour {
 public:
  static constexpr int kBorder = kKernelWidth / 2;

  void resize(int height, int width);
  int height() const { return height_; }
  int width() const { return width_; }
  ptrdiff_t stride() const { return stride_; }
  float* row(int plane, int y) { return values_.data() + at(plane, y); }
  const float* row(int plane, int y) const { return values_.data() + at(plane, y); }
  // Fills the border, after the planes.
  void extend();

 private:
  ptrdiff_t at(int plane, int y) const {
    return (ptrdiff_t(plane) * (height_ + 2 * kBorder) + y + kBorder) * stride_ + kBorder;
  }

  int height_ = 0, width_ = 0;
  ptrdiff_t stride_ = 0;
  Buffer<float> values_;
};

// `logits`: [2][height][width][16], or [4][height][width][8], as `block` says; row-major kernels, dy then dx, from -2 to
// 2; then, if `alpha` is given, one more channel, of which alpha [height][width] becomes the sigmoid. `filtered`: 3 planes,
// which overlap nothing else.
void filterColour(const float* logits, int block, const BorderedColour& colour, const Planes& filtered, float* alpha);

// Each plane of height x width (even) becomes the mean of its 2x2 pixels.
void halve(const ConstPlanes& from, int height, int width, const Planes& to);

// fine += alpha * U(coarse) for planes of height x width (even) and half of both; alpha: one plane like the fine ones.
void addEnlarged(const Planes& fine, int height, int width, const float* alpha, ptrdiff_t alphaStride,
                 const ConstPlanes& coarse);

// fine += alpha * U(coarse - D(fine)) for 3 planes of height x width (even) and half of both. `coarse` becomes the
// difference. alpha: [height][width].
void addCoarse(const Planes& fine, int height, int width, const float* alpha, const Planes& coarse);

}  // namespace fathom::nn
