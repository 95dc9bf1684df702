// Another size of the same picture: proxies, and enlarged images.
#pragma once

#include "deep/ops/resample.h"

namespace fathom::deep {

// The display window becomes one of `width` times `height` pixels, both at least 1, whose corner is the old one scaled
// and rounded; pixels scale along with it, the data window too. With Filter::Box every pixel is the mean of what it
// covers: enlarged by whole factors, pixels are repeated bit for bit. Bilinear is smooth where it enlarges. What becomes
// of samples, channels and attributes is resample's; fathom:ppuScale scales with the width. Throws Error where a size
// is not positive or the tolerance negative, and as `resample` does. Halo: see neededBy with the resizing's rows.
DeepImage resize(DeepImage image, int width, int height, Filter filter = Filter::Box, double tolerance = 0.01);

// How `resize` maps pixels, and the display window that it makes of another.
Resampling resizing(const Box& displayWindow, int width, int height, Filter filter, double tolerance);
Box resizedDisplay(const Box& displayWindow, int width, int height);

}  // namespace fathom::deep
