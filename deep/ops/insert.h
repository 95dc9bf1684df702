// Placing one deep image in another: smoke into a frame.
#pragma once

#include <string>
#include <vector>

#include "deep/ops/transform.h"

namespace fathom::deep {

// The frame with the samples of the other image among its own, after that was moved and scaled (see transform). Merged
// as `merge` does: nothing of the frame changes but what it looks like behind the other's samples. The display window
// is the frame's, the data window holds both. Halo: 0 for the frame, transform's for the other.
DeepImage insert(DeepImage frame, DeepImage other, const Transform& placement);

// What `insert` does to channels, from those of the two images; for the user.
std::vector<std::string> describeInsert(const DeepImage& frame, const DeepImage& other, const Transform& placement);

}  // namespace fathom::deep
