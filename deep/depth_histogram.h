// How much of a deep image lies at which depth.
#pragma once

#include <stop_token>
#include <vector>

#include "deep/image.h"

namespace fathom::deep {

enum class DepthScale { Linear, Log };

// Depths laid out from place 0, at `first`, to place 1, at `last`; both go on beyond. first < last, and 0 < first where
// the scale is Log.
struct DepthAxis {
  DepthScale scale = DepthScale::Linear;
  double first = 0, last = 1;

  double place(double depth) const;  // Log: -infinity for depths of 0 and below
  double depth(double place) const;
  bool operator==(const DepthAxis&) const = default;
};

// From the first to the last depth of an image's samples. Infinite depths do not count, and with Log none at 0 or below,
// nor more than nine decades before the last; a single depth stands in the middle of some room, and without any the ends
// are those of an axis that nobody set (with Log 0.1 and 10). Throws Error where Z is missing.
DepthAxis depthAxis(const DeepImage& image, DepthScale scale);

enum class DepthWeight {
  Seen,    // effective alpha: the sum over an image whose depths are all on the axis is that of its flattened A
  Samples  // each one counts 1
};

// The weight in each of `bins` parts of equal size of an axis, at least 1. A volume is spread over the depths that it
// covers, evenly along its length. What lies beyond the ends is left out; a point at `last` is in the last bin. Throws
// Error where Z is missing and, for Seen, A, and where volumes overlap too much (see `tidy`); Cancelled soon after `stop`
// is raised.
std::vector<double> depthHistogram(const DeepImage& image, const DepthAxis& axis, int bins, DepthWeight weight,
                                   const std::stop_token& stop = {});

}  // namespace fathom::deep
