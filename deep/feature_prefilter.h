// Albedo and normals filtered before they guide the colours.
//
// Source: Vicini et al., section 4.2, "Auxiliary feature prefiltering", with its parameters: the joint deep filter with
// colour weights from the flattened feature itself, and depth as the only feature.
#pragma once

#include "deep/denoise_data.h"
#include "deep/still.h"

namespace fathom::deep {

inline constexpr int kPrefilterRadius = 2, kPrefilterPatchRadius = 1;

// How far from a bin that is to be filtered a feature is read; `reach`: of the colour filter's window and gradients.
inline int featureReach(int reach) {
  return reach + kPrefilterRadius + kPrefilterPatchRadius;
}

// Replaces albedo and normal, where the data has them, by filtered ones, and their variances by those of the filtered
// means: the bin's own share of the weights times its variance, which is exact where the neighbours are as noisy and
// weigh the same.
//
// Only where it will be read: in tiles with a pixel that is not still within `reach`.
void prefilterFeatures(DenoiseData& data, const Activity& activity, int reach);

}  // namespace fathom::deep
