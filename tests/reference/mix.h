// The mix of two estimates written out after the formulas in flat/mix_kernel.h, in double precision, for tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "flat/mix_kernel.h"

namespace fathom::reference {

struct MixNeighbour {
  flat::MixSample sample;
  float reach;
};

inline double mixShare(const flat::MixSample& here, const std::vector<MixNeighbour>& neighbours,
                       const flat::MixParams& params, double floor) {
  double weight = 0, product = 0, square = 0, variance = 0;
  for (const auto& [there, reach] : neighbours) {
    double distance = 0;
    for (int c = 0; c < 3; ++c) {
      const double a = there.mean[c], b = here.mean[c];
      distance += (a - b) * (a - b) / (a * a + b * b + floor);
    }
    const double u = double(there.samples) * double(reach) * std::exp(-4 * distance);
    weight += u;
    for (int c = 0; c < 3; ++c) {
      product += u * double(there.difference[c]) * double(there.residual[c]);
      square += u * double(there.difference[c]) * double(there.difference[c]);
      variance += u * double(there.variance[c]);
    }
  }
  const double prior = double(params.prior), noise = double(params.strength) * variance / weight;
  if (!(weight > 0) || !(square + noise > 0)) return prior;
  return std::clamp((product + noise * prior) / (square + noise), 0.0, 1.0);
}

inline std::vector<MixNeighbour> randomNeighbours(size_t count, float noise, std::mt19937& random) {
  std::normal_distribution<float> normal;
  std::vector<MixNeighbour> result;
  for (size_t i = 0; i < count; ++i) {
    flat::MixSample sample = {};
    sample.samples = float(random() % 33);
    for (size_t c = 0; c < 3; ++c) {
      sample.mean[c] = 0.5f + 0.2f * normal(random);
      sample.difference[c] = 0.1f * normal(random);
      sample.residual[c] = 0.3f * sample.difference[c] + 0.1f * normal(random);
      sample.variance[c] = noise * std::fabs(normal(random));
    }
    result.push_back({sample, 1.0f / float(1 + random() % 5)});
  }
  return result;
}

}  // namespace fathom::reference
