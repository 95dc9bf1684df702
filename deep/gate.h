// The gate: takes back what a filter did to a bin where a residual that neighbours share says that it did damage.
//
// Source: Fathom's own; it is the t-statistic gate of Firmino et al., "Progressive Denoising of Monte Carlo Rendered
// Images", moved to bins. Noise has no direction, damage has. The neighbours d of bin b are, in each pixel of a 7x7
// window, the bin nearest in depth if within 2 %, with weights u_d = n_d exp(-|offset|^2 / 5) exp(-4 sum_c (f_d -
// f_b)^2 / (f_d^2 + f_b^2 + e)), where f is the filtered and y the noisy colour, n the sample count, v the noisy
// variance of the mean. Then m = mean_u(y - f), s2 = mean_u(n v) (the variance of one sample), bias2 = max(0, m^2 - 2
// s2 sum(u^2 / n) / sum(u)^2), k = sum_c bias2 / sum_c (bias2 + s2 / n_b), and the result is f + k (y - f).
#pragma once

#include "deep/denoise_data.h"

namespace fathom::deep {

inline constexpr int kGateRadius = 3;

// What the gate knows of a bin, not premultiplied.
struct GateBin {
  float filtered[3];
  float samples;      // 0: no say, and nothing is taken back
  float residual[3];  // noisy - filtered
  float unused0;
  float variance[3];  // of one sample: the variance of the mean times the number of samples
  float unused1;
};

// k of each bin, in [0,1]. Pixels with still[pixel] != 0 are passed over (k is 0). `level`: the mean colour of the
// frame.
Buffer<float> gate(const DenoiseData& data, const Buffer<GateBin>& bins, const Buffer<uint8_t>& still, float level);

}  // namespace fathom::deep
