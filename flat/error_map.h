// Maps of a denoised render's error that can be looked at and decided by, from the raw estimates of flat/sure.
//
// A denoiser leaves a few hundredths of the noise's variance; SURE's own noise in a pixel is all of it, and after
// smoothing over 11x11 pixels still a sixth: where the denoiser is good, smoothed SURE is mostly noise (its rank
// correlation with the truth is 0.25 to 0.95 on the shared renders). So what is known otherwise is used, too:
// - Means are taken over 11x11 pixels where the denoised colours are alike (flat/bilateral): light and dark do not mix.
// - The error is the filtered value's variance and its squared bias, and the former (ErrorEstimate::spread) is known
//   well. P = ratio * spread is taken as a first guess, with one ratio for the frame, that of the sums of SURE and
//   spread (but for what is a million times the rest, see flat/level); its standard deviation is taken to be as large as
//   itself.
// - A, the smoothed SURE, has variance N = noiseFactor sum w^2 s^4 / (sum w)^2. The map is the mean of both, weighted
//   by the inverses of their variances: (A P^2 + P N) / (P^2 + N), and at least half the spread.
// Measured (docs/notes.md): rank correlation 0.87 on average where smoothed SURE has 0.58.
#pragma once

#include <array>

#include "flat/sure.h"

namespace fathom::flat {

struct ErrorMapParams {
  float noiseFactor = 4;     // 2 for normal noise of known variance; renders have heavier tails
  float mostRatio = 100;     // of SURE to spread, taken over the frame; what is more goes by the noise's variance
  float leastSpread = 0.5f;  // of the spread: the map is not below
};

// Per channel R, G, B and pixel, smoothed alike.
struct ErrorMap {
  std::array<Buffer<float>, 3> error;       // expected squared error of the denoised value, >= 0
  std::array<Buffer<float>, 3> variance;    // of the render
  std::array<Buffer<float>, 3> covariance;  // of both
};

// Needs the whole frame: sums over it decide. The sums' order is fixed. `denoised`: with R, G and B.
ErrorMap mapErrors(const ErrorEstimate& estimate, const Noise& noise, const Image& denoised,
                   const ErrorMapParams& params = {});

// The map as planes error.R, error.G, error.B.
Image errorPlanes(const ErrorEstimate& estimate, const Noise& noise, const Image& denoised);

// The same for a frame whose denoised R, G and B are at hand. Runs the denoiser once per probe. Throws Error where the
// frame says nothing of its noise.
Image errorPlanes(const Image& noisy, const Image& denoised, const Denoiser& denoiser, const SureParams& params = {},
                  const Progress& progress = {});

}  // namespace fathom::flat
