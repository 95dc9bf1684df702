// The brightness of a deep frame, which absolute constants scale with.
#pragma once

#include "deep/image.h"
#include "flat/level.h"

namespace fathom::deep {

// Adds the flattened R, G and B of the pixels with alpha, of a frame that comes in bands of rows from the top: the same
// bits however it is cut.
void addLevel(const DeepImage& rows, flat::LevelSum& level);

}  // namespace fathom::deep
