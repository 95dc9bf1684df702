// Flat images resampled pixel by pixel in double precision, with no code of deep/ops.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "flat/image.h"

namespace fathom::reference {

// A column of the result from X = low to high covers these positions of the source.
struct Interval {
  double low, high;
};

inline double boxWeight(const Interval& covered, int source) {
  return std::max(0.0, std::min(covered.high, source + 1.0) - std::max(covered.low, double(source))) /
         (covered.high - covered.low);
}

// A tent over the pixels that exist: what lies outside has no say.
inline double tentWeight(const Interval& covered, int source, int begin, int end) {
  const double middle = (covered.low + covered.high) / 2, radius = std::max(1.0, covered.high - covered.low);
  const auto tent = [&](int i) { return std::max(0.0, 1 - std::abs(i + 0.5 - middle) / radius); };
  double sum = 0;
  for (int i = begin; i < end; ++i) sum += tent(i);
  return sum > 0 ? tent(source) / sum : 0;
}

// `across` and `down` hold what each column and row of `window` covers.
inline std::vector<double> resampled(const flat::Image& image, const std::string& plane, const Box& window,
                                     const std::vector<Interval>& across, const std::vector<Interval>& down,
                                     bool bilinear) {
  const Box& from = image.dataWindow;
  std::vector<double> result;
  for (int y = 0; y < window.height(); ++y)
    for (int x = 0; x < window.width(); ++x) {
      double sum = 0;
      for (int sy = from.y0; sy < from.y1; ++sy)
        for (int sx = from.x0; sx < from.x1; ++sx) {
          const double value = double(image.get(plane).values[from.index(sx, sy)]);
          const Interval &h = across[size_t(x)], &v = down[size_t(y)];
          sum += value * (bilinear ? tentWeight(h, sx, from.x0, from.x1) * tentWeight(v, sy, from.y0, from.y1)
                                   : boxWeight(h, sx) * boxWeight(v, sy));
        }
      result.push_back(sum);
    }
  return result;
}

}  // namespace fathom::reference
