// Flat images seen as deep ones with a single bin per pixel, so that one algorithm serves both.
#pragma once

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

// One sample in every pixel, a channel for every plane, and `fathom:spp` as an attribute.
DeepImage fromFlat(const flat::Image& image);

// The planes of an image with one sample in every pixel; without attributes.
flat::Image toFlat(const DeepImage& image);

// Makes such samples opaque bins: A becomes 1, so that values are those of the pixel, and Z is 1 where there is none.
// The pixel's own A travels along under a name that no operation knows.
void makeOneBin(DeepImage& image);

// Takes that back: the pixel's own A, or none, and no Z that makeOneBin added.
void unmakeOneBin(DeepImage& image);

}  // namespace fathom::deep
