// Merging deep images: the samples of all, front to back.
#pragma once

#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::deep {

// The samples of all inputs, at least one, sorted front to back by (Z, ZBack); equal ones in the order of the inputs,
// and none is changed, so that flattening sees the light of each behind what stands in front of it. Halo 0.
//
// Data and display windows are the smallest that hold the inputs'. Channels are those of any input: where one has none,
// its samples are 0 there, but a missing ZBack is Z; a channel that is UINT in one and not in another is an Error. A
// channel is FLOAT where any input has it so. Statistics and half buffers that not every input has are left out: they
// would say nothing of the other's samples. Attributes are the first input's, without fathom:spp and deepImageState,
// which do not describe the whole. Throws Error, too, where an input has no A or no Z.
DeepImage merge(std::span<const DeepImage> inputs);
// The same of images that lie apart. Throws Cancelled between rows.
DeepImage merge(std::span<const DeepImage* const> inputs, const std::stop_token& stop = {});

// The channels that `merge` fills up with 0, and those that it leaves out, by layer; a line each for the user.
std::vector<std::string> describeMerge(std::span<const DeepImage> inputs);

}  // namespace fathom::deep
