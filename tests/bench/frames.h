// The frames that benchmarks run on: a small render tiled to a megapixel, and the same with little noise in it.
#pragma once

#include "deep/image.h"

namespace fathom::bench {

// Mirrored copies of an image beside one another, `width` x `height` pixels: edges meet their mirror image, no seam is
// new.
deep::DeepImage tiled(const deep::DeepImage& image, int width, int height);

// The image with a rectangle of a tenth of its area in the middle kept, and no sample outside it.
deep::DeepImage nineTenthsEmpty(const deep::DeepImage& image);

// The image with a rectangle of a tenth of its area in the middle kept, and no noise outside it: both halves are the
// mean there, and every variance is 0.
deep::DeepImage nineTenthsClean(const deep::DeepImage& image);

}  // namespace fathom::bench
