// The gate on pixels: takes back what a denoiser did where a residual that neighbours share says that it did damage.
//
// The decision is that of flat/gate_kernel.h; the neighbours are the 7x7 pixels around, with reach exp(-|offset|^2 /
// 5). Two and a half variances of the mean residual count as noise where the gate on bins has two: two cost the best
// results of Open Image Denoise up to 3 %, and both take 2 % off on average (docs/notes.md).
#pragma once

#include "flat/denoiser.h"
#include "flat/noise.h"

namespace fathom::flat {

struct GateParams {
  float threshold = 2.5f;  // variances of the mean residual that are noise
};

// k of each pixel of the data window, in [0,1]: the gated value is f + k (y - f), with f `denoised` and y `noisy`.
// 0 where the noise is not known or the denoised value is not finite.
Buffer<float> gate(const Image& noisy, const Noise& noise, const Image& denoised, const GateParams& params = {});

// The gated R, G and B.
Image gated(const Image& noisy, const Noise& noise, const Image& denoised, const GateParams& params = {});

// The denoiser with the gate behind it, which R, G and B decide for its components, too. What says nothing of its noise it
// leaves as it is.
Denoiser withGate(Denoiser denoiser, const GateParams& params = {});

}  // namespace fathom::flat
