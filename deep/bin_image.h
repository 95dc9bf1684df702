// Bins as pictures: the k-th bin of every pixel, so that a denoiser of flat images can clean bins.
#pragma once

#include <span>
#include <vector>

#include "deep/denoise.h"
#include "flat/image.h"

namespace fathom::deep {

// The k-th visible bin of every pixel, k = 0 .. count-1, and the last one of a pixel with fewer: R G B, albedo.* and N.*
// where `inputs` has them, not premultiplied, A (1, or 0 where nothing is seen) and flat::kAsked (1 where a pixel has a k-th bin).
// Every image is a whole picture with the hard edges that depth has. A bin is visible that has a say (kLeastShare) and finite colours.
std::vector<flat::Image> binImages(const DeepImage& image, const DenoiseInputs& inputs, int count);

// The effective alpha of all k-th visible bins, k = 0 .. count-1.
std::vector<double> binShares(const DeepImage& image, int count);

// The colours of the bins that `images` (of binImages, at least over the rows of `image`) show, 3 per bin; NaN elsewhere.
Buffer<float> fromBinImages(const DeepImage& image, std::span<const flat::Image> images);

}  // namespace fathom::deep
