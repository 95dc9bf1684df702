// How wrong the flattened result of a denoised deep frame is, pixel by pixel, without a reference.
//
// Source: flat/sure, on bins. Every bin moves along the noise of its own colour (flat/perturb), the frame is denoised
// again, and both are flattened: that tells the covariance of the result with the colours' noise. A pixel's noise has a
// second part, that of its alphas: which camera samples fell where. The denoiser lets it through as it is, so with N
// camera samples its covariance with the result is (sum w c y - sum w c sum w y) / N, with y the noisy and c the
// denoised colours of the bins and w their effective alphas. The variance of the flattened noise has both parts.
#pragma once

#include <functional>

#include "deep/denoise.h"
#include "flat/sure.h"

namespace fathom::deep {

// Adds channels error.{R,G,B} to `denoised`, which `denoiser` made of `noisy` (a whole frame, as `denoise` takes it): the
// estimated squared error of each pixel's flattened colour, shared out so that flattening gives it back. Runs the
// denoiser once per probe. Throws Error where the frame says nothing of its noise, what the denoiser throws, and
// Cancelled.
void addFlattenedErrors(const DeepImage& noisy, const DenoiseInputs& inputs,
                        const std::function<DeepImage(DeepImage, const Progress&)>& denoiser,
                        const flat::SureParams& params, const Progress& progress, DeepImage& denoised);

}  // namespace fathom::deep
