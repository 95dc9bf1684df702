// The colour filter of the denoiser: a bank of candidate filters over every component, in one pass or two.
//
// Source: Vicini et al., sections 4.1 and 4.2. The paper's bank is (k_O, k_f) = (0.45, 0.7), (0.6, 2), (1e4, 2) with
// patches of 3x3; on the shared renders patches of 7x7 have a quarter less error, and a third candidate as careful
// about features as the first 8 % less, 15 % per bin. The second pass of `best` is ours (the idea of a pilot estimate
// is as old as NL-Means): the noisy halves filtered once more, with colour weights from the first pass's halves. The
// result is the mean of both passes, which err differently: 5 % less error than either.
#pragma once

#include <span>
#include <vector>

#include "deep/denoise.h"
#include "deep/guide.h"
#include "deep/joint_filter.h"
#include "deep/still.h"

namespace fathom::deep {

// One pass: the candidates of all its banks, in order, go into one selection. Banks differ in what the candidates of one
// share: windows, patches, tau.
struct FilterPass {
  std::vector<JointFilterParams> banks;

  int candidates() const;
  int radius() const;       // of the largest window
  int guideBorder() const;  // that the guides need
};

// The passes of a plan, first to last. A second one needs halves: the variance of the pilot is their difference.
std::vector<FilterPass> filterPasses(const DenoisePlan& plan);

// What the passes filtered and what they did not; bins count once per component and bank.
struct FilterCounts {
  uint64_t tiles = 0, tilesStill = 0,
           tilesDark = 0;  // all; with nothing noisy; where a component has no light in reach
  uint64_t binsFiltered = 0, binsSkipped = 0;
};

// Filters every component through the passes. `guides`: one per component, with the border of the first pass. Returns,
// per component, 3 values per bin. Progress goes from 0 to 1.
std::vector<Buffer<float>> filterColours(const DenoiseData& data, std::vector<ComponentGuide> guides,
                                         const Activity& activity, std::span<const FilterPass> passes, float level,
                                         const Progress& progress, FilterCounts& counts);

}  // namespace fathom::deep
