// Crop and reformat: which pixels an image has.
#pragma once

#include "deep/image.h"

namespace fathom::deep {

// The image on another data window: pixels outside of the old one are empty, those outside of the new one gone.
// Samples pass bit for bit. Halo 0.
DeepImage toWindow(const DeepImage& image, const Box& window);

// The pixels within `box`, or, with `outside`, all others; the data window becomes the box's part of it, or stays.
// Samples pass bit for bit. Halo 0.
DeepImage crop(const DeepImage& image, const Box& box, bool outside = false);

}  // namespace fathom::deep
