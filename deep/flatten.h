// Flattening: a deep image composited into a flat one.
#pragma once

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

// Every premultiplied channel composited front to back, sums in double precision; half buffers likewise. A is 1 minus
// what passes all samples; NaN alphas count as 0, others are brought into [0,1]; non-finite values (above 1e15
// included) count as 0. Z, and other channels that are not premultiplied, become their mean over the pixel's samples
// weighted by effective alpha, a volume standing for its middle; where nothing has alpha, Z is the nearest. An empty
// pixel is 0 in every channel. Left out: ZBack, UINT channels, and variances and sample counts, which cannot be
// composited. Throws Error when A or Z is missing.
flat::Image flatten(const DeepImage& image);

}  // namespace fathom::deep
