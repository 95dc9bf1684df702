// What the mixing network sees of a render and its candidates (nn/mix).
//
// Source: Fathom's own; nn/train/mix_planes.py makes the same for training. All light is brought to one exposure
// (flat/neural_planes). x is the render, y a candidate; relative quantities are means over R, G, B over
// (mean of y)^2 + 0.01, and their logarithms (log(q + 1e-6) + 5) / 3.
//
//   frame      0-2  log(1 + x)                    candidate  0-2  log(1 + y)
//              3-5  albedo                                   3-5  relative error, spread, and variance of the render
//              6-8  normal                                   6    covariance over variance
//              9    depth z / (z + its mean)                 7    (y - x) over the deviation of x, at most 4
//              10   x's relative variance                    8    the gate's k
//              11   log2(samples) / 4 - 1                    9    as 3, of the frame's mean
//
// Values that are not finite count as 0; in means over the frame the absurd do not (flat/level), which training never sees.
#pragma once

#include <span>

#include "flat/progressive.h"
#include "nn/mix.h"

namespace fathom::flat {

// The arguments outlive it.
nn::MixSource mixSource(const Image& noisy, const Noise& noise, std::span<const Candidate> candidates);

}  // namespace fathom::flat
