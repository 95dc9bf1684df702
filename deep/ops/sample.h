// One deep pixel, sample by sample: what is seen of each.
#pragma once

#include <span>
#include <vector>

#include "deep/image.h"

namespace fathom::deep {

// Of one sample, once the pixel is composited as flatten does.
struct SampleLight {
  double seen = 0;   // effective alpha: what it adds to the pixel's
  double front = 1;  // transmittance in front of where it begins
};

// In the order in which the samples are stored. Samples may lie in any order and overlap; points at the same depth have
// the same in front of them, but in images of camera samples one follows the other (see holdsStatistics). Throws Error
// where A or Z is missing and where the pixel is outside of the data window.
std::vector<SampleLight> lightOf(const DeepImage& image, int x, int y);

// What passes through all that stands in front of each of these depths, which do not fall; points at that depth are not
// included, and inside of volumes it falls exponentially. Throws Error where A or Z is missing and where the pixel is outside of the data window.
std::vector<double> passingTo(const DeepImage& image, int x, int y, std::span<const float> depths);

}  // namespace fathom::deep
