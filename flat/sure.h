// How wrong a denoised render is, pixel by pixel, without a reference, for any denoiser taken as a black box.
//
// Source: Stein's unbiased risk estimate as Firmino et al., "Progressive Denoising of Monte Carlo Rendered Images",
// give it (equations 1 and 2), per pixel and channel: SURE = (f(y) - y)^2 - s^2 + 2 s^2 f'(y), where y is the render,
// s^2 the variance of its means and f the denoiser; s^2 f' is the mean of b (f(y + e b) - f(y)) / e over steps b along
// the noise (flat/perturb). It is unbiased for normal noise whose variance is known, and its own noise is large: that
// of (y - truth)^2 - s^2. See flat/error_map for maps to look at and to decide by.
//
// Beyond the paper: the same runs tell how the filter passes noise on, the mean of ((f(y + e b) - f(y)) / e)^2, which
// is the variance of the filtered value. It is a smooth lower bound of the error.
#pragma once

#include <array>
#include <cstdint>

#include "flat/denoiser.h"
#include "flat/noise.h"

namespace fathom::flat {

struct SureParams {
  int probes = 2;     // runs of the denoiser beside the first; the paper takes 1 or 4
  float size = 0.1f;  // the step in standard deviations of the noise: small beside what the denoiser's weights
                      // notice, large beside the rounding of floats (0.3 to 1: estimates 10 to 40 % too small)
  uint64_t seed = 1;
};

// How a denoised value moves with the noise of the render, per channel R, G, B and pixel of the data window, in squared
// units of the colours.
struct NoiseResponse {
  std::array<Buffer<float>, 3> covariance;  // with the render's own value
  std::array<Buffer<float>, 3> spread;      // the variance of the denoised value
};

// Of the same pixels.
struct ErrorEstimate {
  std::array<Buffer<float>, 3> error;       // SURE: may be negative
  std::array<Buffer<float>, 3> covariance;  // s^2 f': of the noise with the denoised value
  std::array<Buffer<float>, 3> spread;      // the denoised value's variance
};

// `denoised` is what the denoiser makes of `noisy`, for which `noise` was found. The same bits for any number of
// threads, and for any window where the denoiser's are. Where the noise is not known, or a value not finite, error is
// the spread and the covariance 0. Throws what the denoiser throws, Error where a plane is missing, and Cancelled.
ErrorEstimate estimateError(const Image& noisy, const Noise& noise, const Image& denoised, const Denoiser& denoiser,
                            const SureParams& params = {}, const Progress& progress = {});

// The same where the denoiser itself says how its result moves: no further runs. What it says of pixels whose noise is
// not known does not count.
ErrorEstimate estimateError(const Image& noisy, const Noise& noise, const Image& denoised, NoiseResponse response);

}  // namespace fathom::flat
