// The gate written out after the formulas in deep/gate.h, in double precision, for tests.
#pragma once

#include <algorithm>
#include <cmath>

#include "deep/gate.h"

namespace fathom::reference {

// k of the given bin of pixel (x, y).
inline double gate(const deep::DenoiseData& data, const Buffer<deep::GateBin>& bins, int x, int y, size_t b,
                   float level) {
  if (!(bins[b].samples > 0)) return 0;
  const Buffer<float>& depth = data.depth.value[0];
  double sum = 0, squares = 0, residual[3] = {}, variance[3] = {};
  for (int yq = std::max(0, y - 3); yq <= std::min(data.height - 1, y + 3); ++yq)
    for (int xq = std::max(0, x - 3); xq <= std::min(data.width - 1, x + 3); ++xq) {
      const size_t q = size_t(yq) * size_t(data.width) + size_t(xq);
      size_t nearest = data.bins();
      for (size_t d = data.offsets[q]; d < data.offsets[q + 1]; ++d) {
        const float distance = std::fabs(depth[d] - depth[b]);
        if (distance <= 0.02f && (nearest == data.bins() || distance <= std::fabs(depth[nearest] - depth[b])))
          nearest = d;
      }
      if (nearest == data.bins() || !(bins[nearest].samples > 0)) continue;
      const deep::GateBin& d = bins[nearest];
      double distance = 0;
      for (int c = 0; c < 3; ++c) {
        const double fd = d.filtered[c], fb = bins[b].filtered[c];
        distance += (fd - fb) * (fd - fb) / (fd * fd + fb * fb + 4e-4 * double(level) * double(level));
      }
      const double n = d.samples, offset2 = (xq - x) * (xq - x) + (yq - y) * (yq - y);
      const double u = n * std::exp(-offset2 / 5) * std::exp(-4 * distance);
      sum += u;
      squares += u * u / n;
      for (int c = 0; c < 3; ++c) {
        residual[c] += u * double(d.residual[c]);
        variance[c] += u * double(d.variance[c]);
      }
    }
  double biased = 0, all = 0;
  for (int c = 0; c < 3; ++c) {
    const double m = residual[c] / sum, s2 = variance[c] / sum;
    const double bias2 = std::max(0.0, m * m - 2 * s2 * squares / (sum * sum));
    biased += bias2;
    all += bias2 + s2 / double(bins[b].samples);
  }
  return all > 0 ? biased / all : 0;
}

}  // namespace fathom::reference
