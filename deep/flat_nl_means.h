// NL-Means on flat images: the deep filter on one opaque bin per pixel, where it is the flat filter (Vicini et al.,
// section 3.2), so that there is one code for both.
#pragma once

#include "deep/denoise.h"
#include "flat/progressive.h"

namespace fathom::deep {

// The plan for a flat image taken by itself: what it offers, and its mean colour.
DenoisePlan planFlat(const flat::Image& image, const DenoiseParams& params);

// The plan for what flattenNoisy makes of frames with this one, as a guide (which is gated when it is done).
DenoisePlan planFlattened(const DenoisePlan& plan);

// The denoiser of such a plan.
flat::Denoiser flatNlMeans(const DenoisePlan& plan);

// What it makes of an image, and how that moves with the noise: for plans that tell the response (deep/noise_response).
struct FlatAnswer {
  flat::Image denoised;
  flat::NoiseResponse response;
};
FlatAnswer answerNlMeans(const flat::Image& noisy, const DenoisePlan& plan, const Progress& progress = {});

// The same with its estimated errors.
flat::Estimator nlMeansEstimator(const DenoisePlan& plan);

// Adds error.{R,G,B}, the estimated squared errors of `denoised`, which the denoiser made of `noisy`. Both hold one opaque
// bin per pixel, as makeOneBin leaves them, and the whole frame.
void addErrors(const DeepImage& noisy, const DenoiseInputs& inputs, const flat::Denoiser& denoiser,
               const Progress& progress, DeepImage& denoised);

// The same with what `denoise` said of the result: no runs.
void addErrors(const DeepImage& noisy, const DenoiseInputs& inputs, flat::NoiseResponse response, DeepImage& denoised);

}  // namespace fathom::deep
