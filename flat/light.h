// Gives a denoised frame back the light that it lacks.
//
// Source: Fathom's own. A denoiser that goes by relative errors takes light away where noise has bright tails: networks trained on
// SMAPE leave frames 1 to 3 % darker. Over all pixels that it made about as bright, the render tells how bright they are: its noise has
// a mean of 0, and averages out over thousands of pixels. So each octave of brightness gets a factor, linear between octaves, 1 + e max(0, 1 -
// 2 s^2 / e^2), e being the part of its light that is lacking and s the standard error of that, from the residuals: nothing
// where noise cannot tell, or where a firefly that the denoiser removed is all that is lacking. Of that it takes as much as brings
// the frame's light to within 0.4 % of what all of it would.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "base/buffer.h"
#include "flat/image.h"

namespace fathom::flat {

// What to multiply each pixel's colours by, 0.75 to 1.25; empty where none is to be changed. Channels are R, G and B of as many pixels.
// Pixels in `settled` (not 0), and those whose denoised light is not above 0, are not looked at, and keep 1; those whose render is
// not finite do not count. Scaled frames are treated alike.
Buffer<float> lightFactors(const std::array<std::span<const float>, 3>& render, std::span<const uint8_t> settled,
                           const std::array<std::span<const float>, 3>& denoised);

// Multiplies R, G and B of `denoised`, and those of its components, by these factors. Magnitudes stay at most 1e15.
void keepLight(const Image& noisy, std::span<const uint8_t> settled, Image& denoised);

}  // namespace fathom::flat
