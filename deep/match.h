// Which bins of one image are the bins of another: for inputs that were binned apart (half buffers, alphas,
// references).
#pragma once

#include "deep/image.h"

namespace fathom::deep {

struct MatchParams {
  double tolerance = 0.05;  // how far apart two bins may lie, as a part of the depth of the one in `to`
};

// For each sample of `to` the place in `from`'s channels of the sample that matches it, or -1. Samples match within a
// pixel (the same coordinates; data windows may differ), by depth, a volume standing for its middle: the two that are
// nearest to each other first, then the nearest of those that remain, so that none of either image is matched twice.
// Samples may lie in any order. Throws Error when either image lacks Z.
Buffer<int64_t> matchBins(const DeepImage& from, const DeepImage& to, const MatchParams& params = {});

}  // namespace fathom::deep
