// flat/bilateral written out in double precision, for tests.
#pragma once

#include <cmath>
#include <random>
#include <span>
#include <vector>

#include "flat/bilateral.h"

namespace fathom::reference {

// The means of the planes `in` at one pixel; squared: what variances come to in means.
inline std::vector<double> bilateral(int x, int y, const flat::BilateralParams& params,
                                     std::span<const flat::Padded> guide, std::span<const flat::Padded> in,
                                     bool squared = false) {
  std::vector<double> sum(in.size(), 0.0);
  double weight = 0;
  for (int dy = -params.radius; dy <= params.radius; ++dy)
    for (int dx = -params.radius; dx <= params.radius; ++dx) {
      double distance = 0;
      for (const flat::Padded& g : guide) {
        const double a = g.row(y)[x], b = g.row(y + dy)[x + dx];
        distance += (a - b) * (a - b) / (a * a + b * b + double(params.floor));
      }
      const double sigma2 = double(params.sigma) * double(params.sigma);
      const double w = std::exp(-double(params.sharpness) * distance - (dx * dx + dy * dy) / (2 * sigma2));
      weight += w;
      for (size_t i = 0; i < in.size(); ++i) sum[i] += (squared ? w * w : w) * double(in[i].row(y + dy)[x + dx]);
    }
  for (double& s : sum) s /= squared ? weight * weight : weight;
  return sum;
}

inline std::vector<flat::Padded> randomPadded(int count, int width, int height, int pad, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> value(0.1f, 1);
  std::vector<flat::Padded> planes;
  for (int i = 0; i < count; ++i) {
    flat::Padded& plane = planes.emplace_back(width, height, pad);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) plane.row(y)[x] = value(random);
    plane.extend();
  }
  return planes;
}

}  // namespace fathom::reference
