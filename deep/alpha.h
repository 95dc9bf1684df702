// Effective alpha: the share that each sample has of its pixel.
#pragma once

#include "deep/image.h"

namespace fathom::deep {

// Per sample, its alpha times the transmittance of what stands before it in its pixel: a flattened premultiplied
// channel is the sum of effectiveAlpha * value / alpha. Samples are taken front to back as they lie. NaN alphas count
// as 0, others are brought into [0,1]. Throws Error when there is no channel A.
Buffer<float> effectiveAlpha(const DeepImage& image);

}  // namespace fathom::deep
