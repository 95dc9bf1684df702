// How much of each of two estimates goes into a mix, from what neighbours say; shared by pixels (flat/mix) and bins
// (deep/bin_mix).
//
// Source: Fathom's own. Two denoisers a and b err differently, so that their mean is better than both; where one is much
// worse, the noisy values y of the neighbours show it. The share of a is the ridge regression of y - b on a - b over the
// neighbours d, drawn to a share p that is expected: with weights u_d = n_d reach_d exp(-4 sum_c (g_d - g)^2 / (g_d^2 +
// g^2 + floor)), g the mean of a and b, n the sample count, and s2 = mean_u(n v) the pooled variance of one sample,
//   share = sum_c (sum_d u (a - b)(y - b) + strength p s2) / sum_c (sum_d u (a - b)^2 + strength s2),  within [0,1].
// It is the best mix of the squared error where the noise of y does not go with that of a - b (which holds for a filter
// that gives the value itself a small weight), with a prior for it of variance 1 / strength.
#pragma once

#include <cstddef>

namespace fathom::flat {

struct MixSample {
  float mean[3];        // of both estimates
  float samples;        // 0: no say
  float difference[3];  // first - second
  float unused0;
  float residual[3];  // noisy - second
  float unused1;
  float variance[3];  // of one sample
  float unused2;
};

// The neighbours of one value, itself among them; a plane per quantity.
struct MixNeighbours {
  static constexpr size_t kMost = 64;  // 7 x 7, in whole vectors
  alignas(64) float value[14][kMost];  // mean 0-2, samples 3, difference 4-6, residual 7-9, variance 10-12, reach 13
  size_t count = 0;

  // `reach` in (0,1] falls with the distance. At most kMost are added.
  void add(const MixSample& from, float reach) {
    for (size_t c = 0; c < 3; ++c) {
      value[c][count] = from.mean[c];
      value[4 + c][count] = from.difference[c];
      value[7 + c][count] = from.residual[c];
      value[10 + c][count] = from.variance[c];
    }
    value[3][count] = from.samples;
    value[13][count++] = reach;
  }
};

struct MixParams {
  float prior = 0.5f;   // the share of the first that is expected
  float strength = 20;  // how many neighbours that differ by their noise's deviation outweigh what is expected
};

// The share of the first estimate, in [0,1]; the prior where nothing else is known. `floor`: squared values below this
// are alike. Fills the neighbours up with zeros to a whole vector.
float mixShare(const MixSample& here, MixNeighbours& neighbours, const MixParams& params, float floor);

}  // namespace fathom::flat
