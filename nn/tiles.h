// The tiles of a frame through the network, many at once.
#pragma once

#include <cstddef>
#include <span>

#include "base/progress.h"
#include "nn/tile_plan.h"

namespace fathom::nn {

// Denoises the tiles of a frame whose sides are multiples of 4; what lies in no tile of `out` stays as it is. `out` overlaps
// no input. `memory`: that the tiles were planned for; where not every thread's tile fits it, fewer threads work. Same bits
// for any number of threads.
void denoiseTiles(const CompositionalNet& net, const CompositionalInput& frame, std::span<const Tile> tiles,
                  const Planes& out, size_t memory = 0, const Progress& progress = {});

}  // namespace fathom::nn
