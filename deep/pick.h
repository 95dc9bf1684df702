// Some of an image's pixels and channels, as an image of its own.
#pragma once

#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::deep {

// The pixels of `box` whose distance from its corner is a multiple of `step`, at least 1, with those of the channels that
// the image has. The windows begin at (0, 0); pixels outside of the data window are empty; attributes stay.
DeepImage pick(const DeepImage& image, const Box& box, int step, const std::vector<std::string>& channels);

}  // namespace fathom::deep
