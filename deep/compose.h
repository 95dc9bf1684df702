// From filtered components back to the colours of the bins.
//
// Source: Vicini et al., section 5.2: the albedo multiplied back, the components added.
#pragma once

#include <span>
#include <vector>

#include "deep/denoise_data.h"
#include "deep/gate.h"
#include "deep/guide.h"

namespace fathom::deep {

// The variance of one camera sample as the flattened guides tell it, per component and channel a plane over the pixels;
// nothing where halves or the file tell it by bin.
std::vector<std::array<Buffer<float>, 3>> pixelVariance(const DenoiseData& data, std::span<const ComponentGuide> guides,
                                                        const DenoiseInputs& inputs);

// Multiplies the albedo back into `filtered` (per component 3 values per bin) and fills what the gate needs of each
// bin, with the noisy colours from `image`; bins that only still pixels see are not set. `ofPixels`: pixelVariance's.
Buffer<GateBin> compose(const DeepImage& image, const DenoiseData& data, const DenoiseInputs& inputs,
                        const Buffer<uint8_t>& still, std::span<const std::array<Buffer<float>, 3>> ofPixels,
                        std::span<Buffer<float>> filtered);

// The gated colours of the bins, 3 per bin, not premultiplied.
Buffer<float> gatedColours(const DenoiseData& data, const Buffer<GateBin>& bins, const Buffer<flat::GateVerdict>& gates,
                           const Buffer<uint8_t>& still);

// Writes f + k (y - f), premultiplied, by component and whole. `colours`, where there are any: the whole of each bin (3
// values, not premultiplied) as it shall be; the components get of what that differs by as much as they have of the
// light. Still pixels stay as they are, and bins without a weight, which nothing could fill: what is not finite there
// becomes 0.
void writeColours(DeepImage& image, const DenoiseData& data, const Buffer<uint8_t>& still,
                  std::span<const Buffer<float>> filtered, const Buffer<flat::GateVerdict>& gates,
                  const Buffer<float>& colours);

}  // namespace fathom::deep
