// Maps of one value per pixel, and how alike two of them are, for tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace fathom::reference {

using PixelMap = std::vector<double>;

// Means over 11x11 pixels.
inline PixelMap boxMean(const PixelMap& in, int width, int height) {
  PixelMap result(in.size());
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double sum = 0;
      int count = 0;
      for (int yq = std::max(0, y - 5); yq <= std::min(height - 1, y + 5); ++yq)
        for (int xq = std::max(0, x - 5); xq <= std::min(width - 1, x + 5); ++xq, ++count)
          sum += in[size_t(yq * width + xq)];
      result[size_t(y * width + x)] = sum / count;
    }
  return result;
}

inline PixelMap ranks(const PixelMap& values) {
  std::vector<size_t> order(values.size());
  std::iota(order.begin(), order.end(), size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return values[a] < values[b]; });
  PixelMap result(values.size());
  for (size_t i = 0; i < order.size(); ++i) result[order[i]] = double(i);
  return result;
}

// The rank correlation.
inline double spearman(const PixelMap& a, const PixelMap& b) {
  const PixelMap x = ranks(a), y = ranks(b);
  const double mean = double(x.size() - 1) / 2;
  double xy = 0, xx = 0, yy = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    xy += (x[i] - mean) * (y[i] - mean);
    xx += (x[i] - mean) * (x[i] - mean);
    yy += (y[i] - mean) * (y[i] - mean);
  }
  return xy / std::sqrt(xx * yy);
}

inline double sum(const PixelMap& map) {
  return std::accumulate(map.begin(), map.end(), 0.0);
}

}  // namespace fathom::reference
