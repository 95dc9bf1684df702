// Keymix: one deep image where a flat matte is 1, another where it is 0, and the mean of both between.
#pragma once

#include <string_view>

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

// Per pixel the mean of both deep pixels with the weights m and 1 - m, m being the channel of the matte: flattened, up
// to any depth at which a sample of the result ends, it is the mean of both flattened (see AreaMean: each covers its
// part of the pixel and hides nothing of the other's). Where m is 1 or 0 the samples of one pass bit for bit, if they
// are tidy; others are tidied first. m is brought into [0,1]; NaN is 0, and so is what lies outside of the matte.
//
// Windows, channels and attributes are those of the merge of both images, which fills up with 0 what one of them lacks;
// statistics and half buffers are left out. Throws Error where the matte has no such channel, and as `merge` and `tidy`
// do. Halo 0.
DeepImage keymix(const DeepImage& one, const DeepImage& zero, const flat::Image& matte, std::string_view channel);

}  // namespace fathom::deep
