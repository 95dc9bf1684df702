// The colour filter of the denoiser: a bank of candidate filters over every component, in one pass or two.
//
// Source: Vicini et al., sections 4.1 and 4.2. Which candidates there are is said in deep/filter_passes.
#pragma once

#include <span>
#include <vector>

#include "deep/filter_passes.h"
#include "deep/guide.h"
#include "deep/still.h"

namespace fathom::deep {

// What the passes filtered and what they did not; bins count once per component and bank.
struct FilterCounts {
  uint64_t tiles = 0, tilesStill = 0,
           tilesDark = 0;  // all; with nothing noisy or no light at all; where one component has none in reach
  uint64_t binsFiltered = 0, binsSkipped = 0;
};

// Filters every component through the passes. `guides`: one per component, with the border of the first pass. Returns,
// per component, 3 values per bin. `answers`, where given, gets what the halves of each component tell; still pixels have
// 0. Progress goes from 0 to 1.
std::vector<Buffer<float>> filterColours(const DenoiseData& data, std::vector<ComponentGuide> guides,
                                         const Activity& activity, std::span<const FilterPass> passes, float level,
                                         const Progress& progress, FilterCounts& counts,
                                         std::vector<HalfAnswer>* answers = nullptr);

}  // namespace fathom::deep
