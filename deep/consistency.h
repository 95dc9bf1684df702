// Bins that add up to a better flat picture, changed as little as their own errors allow.
//
// Source: Fathom's own. Given the denoised bins c_n of a pixel with effective alphas w_n and expected squared errors v_n,
// and what the pixel should be, F, the change of smallest sum of (change_n)^2 / v_n that makes sum w_n c_n equal F is
//   c_n += v_n w_n (F - sum w_m c_m) / sum v_m w_m^2.
// The alphas are noisy, too, and F is not: N camera samples leave a variance a = (sum w c^2 - (sum w c)^2) / N that is no
// fault of the bins' colours. It goes into the denominator, a part of it: with all of it the flattened frame misses
// a good guide by a tenth where bins differ much, with none the bins follow it across depth edges (pixels that a clip
// plane cuts had up to 1.7 times their error). No light becomes negative, and no bin moves by more than ten of its
// own deviations: with three, dark bins whose few samples missed the light, and so are sure of it, stay dark dots.
#pragma once

#include <span>

#include "deep/base_guide.h"
#include "deep/denoise_data.h"
#include "deep/gate.h"

namespace fathom::deep {

inline constexpr int kConsistencyRadius = flat::kNeighbourRadius;  // of the mix of both flat pictures

// Changes `colours` (3 per bin, not premultiplied) so that the pixels come near the mix of what they are and of
// `guide.flattened` that the noisy frame favours. `image`, `data` and `guide` have the same rows; `gates` are the bins'
// verdicts, after which the colours were gated. Pixels with still[pixel] != 0 stay.
void makeConsistent(const DeepImage& image, const DenoiseData& data, const BaseGuide& guide,
                    const Buffer<flat::GateVerdict>& gates, const Buffer<uint8_t>& still, float level,
                    Buffer<float>& colours);

}  // namespace fathom::deep
