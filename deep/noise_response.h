// How the result of our own filter moves with the noise of a flat frame, from the filter itself: no further runs.
//
// Source: Stein's estimate as the header of deep/selection has it, without derivatives of the weights. Halves c_0 and c_1
// of the render y = p_0 c_0 + p_1 c_1 (p their parts of the samples) become F_0 and F_1, with weights that are made from
// the other half; the result F is their mean. Then, in the mean,
//   error = mean_h [(F_h - c_h)^2 - Var c_h + 2 Cov(F_h, c_h)] - (F_0 - F_1)^2 / 4,
// and with d = c_0 - c_1, whose square is Var y / (p_0 p_1) in the mean, that is
//   error = (F - y)^2 - Var y + 2 C,  2 C = (p_0 - p_1) (F - y) d - (F_0 - F_1) d / 2 + sum_h Cov(F_h, c_h).
// C is what flat/sure calls the covariance. With a component's own share s_h of its sum of weights,
//   Cov(F_h, c_h) = sum over components of s_h (part of Var y) Var y / p_h.
// A component's part is its covariance with the whole over the whole's variance, both from the differences of halves and
// pooled over 5x5 pixels. What light is multiplied back with, the prefiltered albedo, is as good as a component: its
// share is its own one of the prefilter, and where several surfaces share a pixel it moves with the light.
//
// The same shares tell the variance of the result: a mean whose weights are 0 or that of the pixel itself has s_h Var c_h.
// That is an upper bound for neighbours that are as noisy, and much smoother than (F_0 - F_1)^2 / 4.
//
// Weights do know a little of what they average: by the variance that both halves share, by the choice among candidates,
// by noisy features, and in a second pass by its pilots. All that is taken for constant, and so is the gate. Hence
// estimates are too small where much is left to choose (docs/notes.md).
#pragma once

#include <span>

#include "deep/denoise_data.h"
#include "deep/gate.h"
#include "deep/selection.h"
#include "flat/sure.h"

namespace fathom::deep {

// Whether flat frames of this plan tell all of that: halves, those of the albedo too where light is divided by it.
bool tellsResponse(const DenoisePlan& plan);

// How the halves of a frame with one opaque bin per pixel differ: half 0 less half 1, by channel and pixel; 0 where one
// of them has nothing, or is not finite.
struct HalfDifferences {
  std::array<Buffer<float>, 3> light, albedo;  // albedo: empty where nothing is divided by it
};

HalfDifferences halfDifferences(const DeepImage& image, const DenoiseInputs& inputs, const DenoiseData& data);

// What the filter of such a frame knows when it is done. `image` still has its variance.*, where the file tells them.
struct FilterResult {
  const DeepImage& image;
  const DenoiseInputs& inputs;
  const DenoiseData& data;
  const HalfDifferences& differences;
  std::span<const HalfAnswer> answers;      // of components
  std::span<const Buffer<float>> filtered;  // of components, per bin 3, the albedo multiplied back
  const Buffer<GateBin>& bins;
  const Buffer<flat::GateVerdict>& gates;
  const Buffer<uint8_t>& still;
};

// Still pixels move as the render does.
flat::NoiseResponse noiseResponse(const FilterResult& result);

}  // namespace fathom::deep
