// A cross-bilateral mean: planes averaged where a guide is alike, which is NL-Means with patches of one pixel.
#pragma once

#include <cstdint>
#include <span>

#include "flat/padded.h"

namespace fathom::flat {

struct BilateralParams {
  int radius = 5;
  float sigma = 2.5f;   // of the distance in pixels
  float sharpness = 2;  // of the guide: exp(-sharpness * sum_c (a_c - b_c)^2 / (a_c^2 + b_c^2 + floor))
  float floor = 1e-4f;  // squared guide values below this are alike
};

// `wanted`: one byte per pixel; where it is 0 the result may be anything finite. Weighted means of the planes `in`,
// into `out` (as many, of width x height; none of them an input). All inputs are padded by at least `radius` and
// extended. Values are finite and below 1e17 in the guide, so that squares are.
void bilateral(int width, int height, const BilateralParams& params, const Buffer<uint8_t>& wanted,
               std::span<const Padded> guide, std::span<const Padded> in, std::span<Padded> out);

// What variances of independent values come to in those means: sum w^2 v / (sum w)^2 of the planes `in`.
void bilateralVariance(int width, int height, const BilateralParams& params, const Buffer<uint8_t>& wanted,
                       std::span<const Padded> guide, std::span<const Padded> in, std::span<Padded> out);

}  // namespace fathom::flat
