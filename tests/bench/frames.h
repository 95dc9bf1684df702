// The frames that benchmarks run on: a small render tiled to a megapixel, and the same with noise in a part of it alone.
#pragma once

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::bench {

// Mirrored copies of an image beside one another, `width` x `height` pixels: edges meet their mirror image, no seam is
// new.
deep::DeepImage tiled(const deep::DeepImage& image, int width, int height);

// A rectangle in the middle of a window, of its shape and such a share of its area.
Box middleOf(const Box& window, double share);

// What the pixels outside of a box become: empty, or free of noise, with both halves as the mean and every variance 0.
enum class Rest { empty, converged };
deep::DeepImage keepNoisy(const deep::DeepImage& image, const Box& kept, Rest rest);
flat::Image keepNoisy(const flat::Image& image, const Box& kept, Rest rest);

}  // namespace fathom::bench
