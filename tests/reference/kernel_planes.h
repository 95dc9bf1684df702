// What the networks' kernels work on, made of plain volumes; and the splatting kernel's twin. For tests and benchmarks.
#pragma once

#include <algorithm>
#include <cmath>

#include "nn/kernel_filter.h"
#include "nn/layers_kernel.h"
#include "tests/reference/layers.h"

namespace fathom::reference {

// Channels in groups, the last filled up with `rest`; exactly as many floats as there are, so that reading more is found.
inline Buffer<float> grouped(const Volume& volume, int block, int groups, float rest) {
  const int pixels = volume.height * volume.width;
  Buffer<float> result(size_t(groups * block * pixels), rest);
  for (int c = 0; c < volume.channels; ++c)
    for (int i = 0; i < pixels; ++i)
      result[size_t((c / block * pixels + i) * block + c % block)] = float(volume.values[size_t(c * pixels + i)]);
  return result;
}

inline nn::BorderedColour bordered(const Volume& colour) {
  nn::BorderedColour result;
  result.resize(colour.height, colour.width);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < colour.height; ++y)
      for (int x = 0; x < colour.width; ++x) result.row(c, y)[x] = float(colour.at(c, y, x));
  result.extend();
  return result;
}

inline nn::WidePlanes wide(const Volume& volume) {
  nn::WidePlanes result;
  result.resize(size_t(volume.channels), volume.height, volume.width);
  for (int c = 0; c < volume.channels; ++c)
    for (int y = 0; y < volume.height; ++y)
      for (int x = 0; x < volume.width; ++x) result.row(size_t(c), y)[x] = float(volume.at(c, y, x));
  result.clearBorders();
  return result;
}

// Sums by source pixels, where the kernel gathers by result pixels.
inline Volume splatted(const Volume& logits, const Volume& values) {
  Volume sum(6, values.height, values.width), out(5, values.height, values.width);
  for (int y = 0; y < values.height; ++y)
    for (int x = 0; x < values.width; ++x)
      for (int k = 0; k < 25; ++k) {
        const int ty = y + k / 5 - 2, tx = x + k % 5 - 2;
        if (ty < 0 || tx < 0 || ty >= values.height || tx >= values.width) continue;
        const double weight = std::exp(std::clamp(logits.at(k, y, x), -12.0, 12.0));
        for (int c = 0; c < 6; ++c) sum.at(c, ty, tx) += weight * values.at(c, y, x);
      }
  for (int i = 0; i < values.height * values.width; ++i) {
    const int y = i / values.width, x = i % values.width;
    const double n = sum.at(4, y, x) + 1e-12;
    for (int c = 0; c < 3; ++c) out.at(c, y, x) = sum.at(c, y, x) / n;
    out.at(3, y, x) = std::min(1.0, sum.at(3, y, x) / n);
    out.at(4, y, x) = sum.at(5, y, x) / n;
  }
  return out;
}

}  // namespace fathom::reference
