// Clipping: what lies between two depths.
#pragma once

#include "deep/image.h"

namespace fathom::deep {

// The samples in the half-open range [near, far); volumes that reach beyond it are cut, so that the part in front of a
// depth over the part behind it is the whole. Samples that are not cut pass bit for bit; where one is cut, the channels
// that describe its camera samples (half buffers, variances, counts) are void and left out of the result. Throws Error
// when A or Z is missing.
DeepImage clip(const DeepImage& image, float near, float far);

}  // namespace fathom::deep
