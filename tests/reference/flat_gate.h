// The gate on pixels written out after the formulas in flat/gate_kernel.h and flat/gate.h, in double precision, for
// tests.
#pragma once

#include <algorithm>
#include <cmath>

#include "flat/gate.h"

namespace fathom::reference {

// k of the pixel x, y of the data window, counted from its corner; all pixels are known and finite.
inline double gate(const flat::Image& noisy, const flat::Noise& noise, const flat::Image& denoised, int x, int y,
                   double threshold) {
  const int width = noisy.dataWindow.width(), height = noisy.dataWindow.height();
  const auto at = [&](const flat::Image& image, int c, int i) {
    return double(image.get(flat::kRgbNames[size_t(c)]).values[size_t(i)]);
  };
  const double level = double(noise.level), floor = 4e-4 * level * level;
  const int here = y * width + x;
  double sum = 0, squares = 0, residual[3] = {}, variance[3] = {};
  for (int yq = std::max(0, y - 3); yq <= std::min(height - 1, y + 3); ++yq)
    for (int xq = std::max(0, x - 3); xq <= std::min(width - 1, x + 3); ++xq) {
      const int q = yq * width + xq;
      double distance = 0;
      for (int c = 0; c < 3; ++c) {
        const double a = at(denoised, c, q), b = at(denoised, c, here);
        distance += (a - b) * (a - b) / (a * a + b * b + floor);
      }
      const double n = double(noise.samples[size_t(q)]), offset2 = (xq - x) * (xq - x) + (yq - y) * (yq - y);
      const double u = n * std::exp(-offset2 / 5) * std::exp(-4 * distance);
      sum += u;
      squares += u * u / n;
      for (int c = 0; c < 3; ++c) {
        residual[c] += u * (at(noisy, c, q) - at(denoised, c, q));
        variance[c] += u * n * double(noise.variance[size_t(c)][size_t(q)]);
      }
    }
  double biased = 0, all = 0;
  for (int c = 0; c < 3; ++c) {
    const double m = residual[c] / sum, s2 = variance[c] / sum;
    const double bias2 = std::max(0.0, m * m - threshold * s2 * squares / (sum * sum));
    biased += bias2;
    all += bias2 + s2 / double(noise.samples[size_t(here)]);
  }
  return all > 0 ? biased / all : 0;
}

}  // namespace fathom::reference
