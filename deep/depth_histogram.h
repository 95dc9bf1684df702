// How much of a deep image lies at which depth.
#pragma once

#include <stop_token>
#include <vector>

#include "deep/depth_axis.h"
#include "deep/image.h"

namespace fathom::deep {

// Around the first and last depth of an image's samples (see axisAround). Infinite depths do not count, and on a
// logarithmic axis none at 0 or below, nor more than nine decades before the last. Throws Error where Z is missing.
DepthAxis axisOf(const DeepImage& image, bool logarithmic);

enum class DepthWeight {
  Seen,    // effective alpha: the sum over an image whose depths are all on the axis is that of its flattened A
  Samples  // each one counts 1
};

// The weight in each of `bins` parts of equal size of an axis, at least 1. A volume is spread over the depths that it
// covers, evenly along its length. What lies beyond the ends is left out; a point at `far` is in the last bin. Throws
// Error where Z is missing and, for Seen, A, and where volumes overlap too much (see `tidy`); Cancelled soon after `stop`
// is raised.
std::vector<double> depthHistogram(const DeepImage& image, const DepthAxis& axis, int bins, DepthWeight weight,
                                   const std::stop_token& stop = {});

}  // namespace fathom::deep
