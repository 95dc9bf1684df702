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

}  // namespace fathom::reference
