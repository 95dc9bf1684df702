// What a deep image shows between two depths, fast enough to follow a plane that is dragged.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "deep/depth_range.h"
#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

// The pixels of `box` whose distance from its corner is a multiple of `step`, at least 1, as flatten makes them of what
// `range` leaves: with hard planes, and not inverted, flatten(clip(image, near, far)). Volumes are split at the planes
// exactly; see RangeCut for soft ones. Only these pixels' samples are read.
//
// The result has the planes `channels`, each once, and A; its data window begins at (0, 0). Pixels outside of the
// image's data window are 0. The channels are any but UINT ones, those that flatten leaves out among them: ZBack is the
// mean depth of where things end, weighted as Z is; variances are those of a sum of independent samples (the factors of
// the values squared); counts are summed over the samples of which something is left.
//
// Throws Error where A, Z or a channel is missing, where one is UINT, and where volumes overlap too much (see `tidy`).
flat::Image clipView(const DeepImage& image, const Box& box, int step, const DepthRange& range,
                     const std::vector<std::string>& channels);

// The same, into planes that are there: one for each of the channels, which are different ones without A, and one for A,
// which comes last. Rows follow one another.
void clipViewInto(const DeepImage& image, const Box& box, int step, const DepthRange& range,
                  const std::vector<std::string>& channels, std::span<float* const> planes);

}  // namespace fathom::deep
