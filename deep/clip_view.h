// What a deep image shows between two depths, fast enough to follow a plane that is dragged.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

// Half-open as in deep/clip: [near, far), and with an infinite `far` all that is behind `near`.
struct DepthRange {
  float near = -std::numeric_limits<float>::infinity();
  float far = std::numeric_limits<float>::infinity();
  float soft = 0;         // depth over which samples fade in behind `near` and out before `far`; 0: a hard plane
  bool inverted = false;  // what the range leaves out

  bool isAll() const {
    return near == -std::numeric_limits<float>::infinity() && far == std::numeric_limits<float>::infinity() &&
           !inverted;
  }
  bool operator==(const DepthRange&) const = default;
};

// The pixels of `box` whose distance from its corner is a multiple of `step`, as flatten makes them of what `range`
// leaves (with soft == 0 and not inverted: flatten(clip(image, near, far))). The result has the planes `channels`, which
// the image must have but for UINT ones, and A; its data window begins at (0, 0). Outside of the data window: 0. Volumes
// are split at the planes exactly. A soft edge fades a sample by its middle depth: alpha and premultiplied values are
// multiplied by it. Throws Error where A, Z or a channel is missing, and where volumes overlap too much (see `tidy`).
flat::Image clipView(const DeepImage& image, const Box& box, int step, const DepthRange& range,
                     const std::vector<std::string>& channels);

}  // namespace fathom::deep
