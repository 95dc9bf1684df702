// Placing one deep image in another: smoke into a frame.
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "deep/ops/transform.h"

namespace fathom::deep {

// The frame with the samples of the other image among its own, after that was moved and scaled (see transform). Merged
// as `merge` does: nothing of the frame changes but what it looks like behind the other's samples. The display window
// is the frame's, the data window holds both. Halo: 0 for the frame, transform's for the other. Throws Cancelled between
// rows.
DeepImage insert(const DeepImage& frame, DeepImage other, const Transform& placement, const std::stop_token& stop = {});

// A few pixels and channels of what `insert` makes, at the cost of those alone: the pixels of `box` whose distance from
// its corner is a multiple of `step`, with A, Z, ZBack and those of `channels` that there are; sample by sample the same.
// The data window begins at (0, 0). The placement must move by whole pixels.
DeepImage insertPart(const DeepImage& frame, const DeepImage& other, const Transform& placement, const Box& box,
                     int step, const std::vector<std::string>& channels);

// What `insert` does to channels, from those of the two images; for the user.
std::vector<std::string> describeInsert(const DeepImage& frame, const DeepImage& other, const Transform& placement);

}  // namespace fathom::deep
