// Two estimates of a frame mixed pixel by pixel, as the noisy render around says which errs less (flat/mix_kernel).
#pragma once

#include "flat/mix_kernel.h"
#include "flat/noise.h"

namespace fathom::flat {

// R, G and B of b + share (a - b), with the 7x7 pixels around as neighbours, whose reach is exp(-|offset|^2 / 5). All
// images have the same data window. Where the noise is not known nothing but the prior tells; where one estimate is not
// finite the other is taken.
Image mixed(const Image& noisy, const Noise& noise, const Image& first, const Image& second,
            const MixParams& params = {});

}  // namespace fathom::flat
