// A frame through the network in tiles, many at once.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "base/progress.h"
#include "nn/compositional.h"

namespace fathom::nn {

struct TileParams {
  // What may be held besides the frame and the result; 0: no limit. Tiles have 512 pixels a side; 256 at least where eight
  // would not fit at once; and 64 at least where one would not. Where not every thread's tile fits, fewer threads work.
  size_t memory = 0;
};

// The tiles of a frame, in rows. They depend on the frame's size, the network and the memory limit, not on the threads.
std::vector<Window> tilesOf(const CompositionalNet& net, int height, int width, int mostComponents,
                            const TileParams& params);

// Denoises a frame whose sides are multiples of 4. `components` tells how many components a tile is worth (1, 2 or 4, at
// most `mostComponents`), or 0 where there is nothing to do: that tile of `out` stays as it is. It is called from many
// threads at once. `out` overlaps no input. Same bits for any number of threads.
void denoiseTiles(const CompositionalNet& net, const CompositionalInput& frame, int mostComponents,
                  const std::function<int(const Window& tile)>& components, const Planes& out,
                  const TileParams& params = {}, const Progress& progress = {});

}  // namespace fathom::nn
