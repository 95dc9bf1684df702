// The gate's decision for one filtered value, shared by pixels (flat/gate) and bins (deep/gate).
//
// Source: Fathom's own; it is the t-statistic gate of Firmino et al., "Progressive Denoising of Monte Carlo Rendered
// Images", section 4.2, on the residual. Noise has no direction, damage has. With weights u_d = n_d reach_d exp(-4
// sum_c (f_d - f)^2 / (f_d^2 + f^2 + floor)) of the neighbours d, where f is the filtered and y the noisy colour, n the
// sample count and v the noisy variance of the mean: m = mean_u(y - f), s2 = mean_u(n v) (the variance of one sample),
// bias2 = max(0, m^2 - threshold s2 sum(u^2 / n) / sum(u)^2), k = sum_c bias2 / sum_c (bias2 + s2 / n). The result is f
// + k (y
// - f).
#pragma once

#include <cstddef>

namespace fathom::flat {

// What the gate knows of a value, not premultiplied.
struct GateSample {
  float filtered[3];
  float samples;      // 0: no say, and nothing is taken back
  float residual[3];  // noisy - filtered
  float unused0;
  float variance[3];  // of one sample: the variance of the mean times the number of samples
  float unused1;
};

// The neighbours of one value, itself among them; a plane per quantity.
struct GateNeighbours {
  static constexpr size_t kMost = 64;  // 7 x 7, in whole vectors
  alignas(64) float value[11][kMost];  // filtered 0-2, samples 3, residual 4-6, variance 7-9, reach 10
  size_t count = 0;

  // `reach` in (0,1] falls with the distance. At most kMost are added.
  void add(const GateSample& from, float reach) {
    for (size_t c = 0; c < 3; ++c) {
      value[c][count] = from.filtered[c];
      value[4 + c][count] = from.residual[c];
      value[7 + c][count] = from.variance[c];
    }
    value[3][count] = from.samples;
    value[10][count++] = reach;
  }
};

struct GateVerdict {
  float k = 0;       // in [0,1]
  float bias2[3]{};  // the squared bias of the filtered value, as far as it is told from noise
  float noise[3]{};  // the variance of the noisy value, pooled over the neighbours
};

// `threshold`: how many variances of the mean residual are noise; `floor`: squared filtered
// values below this are alike. Fills the neighbours up with zeros to a whole vector.
GateVerdict takenBack(const GateSample& here, GateNeighbours& neighbours, float threshold, float floor);

}  // namespace fathom::flat
