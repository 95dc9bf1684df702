// Structural similarity of two planes.
//
// Source: Wang, Bovik, Sheikh, Simoncelli, "Image Quality Assessment: From Error Visibility to Structural Similarity",
// 2004.
#pragma once

#include <cstdint>
#include <span>

namespace fathom::flat {

// Mean SSIM of planes x and y of width x height values in [0,1]. Windows are Gaussian, 11 x 11, sigma 1.5; the mean is
// over the used pixels whose whole window is inside, or over all where the image is smaller than a window. Pixels with
// used = 0 have no say in any window. Same bits for any number of threads. 1 where nothing is used.
double ssim(std::span<const float> x, std::span<const float> y, std::span<const uint8_t> used, int width, int height);

}  // namespace fathom::flat
