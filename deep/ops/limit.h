// Fewer samples where a pixel has many.
#pragma once

#include "deep/image.h"

namespace fathom::deep {

// At most `most` samples in a pixel, which is at least 1. In a pixel that has more, neighbours in depth become one until
// they fit: first those whose union changes the least of what is seen at any depth (opacity and R, G, B; distances
// count relative to the depth), so samples that nothing is seen of go first. The pixel is made tidy before, since
// overlapping volumes have no order. Other pixels pass bit for bit, and so do the samples of a pixel that stay as they
// are; a union has the alpha and the light of its samples composited, the id of the one that is most seen, and is a
// point at their mean depth where points make up most of it, else a volume over all of them. Flattened, nothing
// changes by more than 2^-21 of the largest sum of the magnitudes of a pixel's samples.
//
// Statistics and half buffers, which would be void where samples are united, are dropped, and so is deepImageState;
// fathom:spp stays, since alphas still count rays. Takes n log n time in a pixel of n samples that do not overlap.
// Throws Error where A or Z is missing, where `most` is less than 1 and where volumes overlap too much (see tidy).
// Halo 0.
DeepImage limit(DeepImage image, int most);

}  // namespace fathom::deep
