// Two estimates of every bin mixed, as the noisy bins around say which errs less (flat/mix_kernel).
#pragma once

#include <span>

#include "deep/gate.h"

namespace fathom::deep {

// Replaces the filtered colours of `bins` by their mix with `second` (3 values per bin, not premultiplied; a bin whose
// second colour is not finite keeps its first), and the residuals with them. Pixels with still[pixel] != 0 are passed
// over. `level`: the mean colour of the frame; `prior`: the share of the first that is expected.
void mixBins(const DenoiseData& data, std::span<const float> second, const Buffer<uint8_t>& still, float level,
             float prior, Buffer<GateBin>& bins);

}  // namespace fathom::deep
