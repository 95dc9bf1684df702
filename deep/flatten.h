// Flattening: a deep image composited into a flat one.
#pragma once

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

// Every premultiplied channel composited front to back, sums in double precision; half buffers likewise. Samples may
// lie in any order and overlap: they are sorted, split and merged as `tidy` does; but points at the same depth are
// composited one after the other in an image of camera samples or of bins made of them (attribute fathom:spp, or
// channels of statistics), whose alphas count samples. NaN alphas count as 0, others are brought into [0,1]; non-finite
// values (above 1e15 included) count as 0. Z, and other channels that are not premultiplied, become their mean over the
// pixel's samples weighted by effective alpha, a volume standing for its middle; where nothing has alpha, Z is the
// nearest. An empty pixel is 0 in every channel. Left out: ZBack, UINT channels, and variances and sample counts, which
// cannot be composited. Throws Error when A or Z is missing, and where volumes overlap too much (see `tidy`).
flat::Image flatten(const DeepImage& image);

}  // namespace fathom::deep
