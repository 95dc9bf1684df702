// The gate: takes back what a filter did to a bin where a residual that neighbours share says that it did damage.
//
// The decision is that of flat/gate_kernel.h. The neighbours of a bin are, in each pixel of a 7x7 window, the bin
// nearest in depth if within 2 %, with reach exp(-|offset|^2 / 5); two variances of the mean residual are noise.
#pragma once

#include "deep/denoise_data.h"
#include "flat/gate_kernel.h"
#include "flat/neighbourhood.h"

namespace fathom::deep {

inline constexpr int kGateRadius = flat::kNeighbourRadius;

using GateBin = flat::GateSample;

// What to take back of each bin. Pixels with still[pixel] != 0 are passed over (k is 0). `level`: the mean colour of the
// frame.
Buffer<flat::GateVerdict> gate(const DenoiseData& data, const Buffer<GateBin>& bins, const Buffer<uint8_t>& still,
                               float level);

}  // namespace fathom::deep
