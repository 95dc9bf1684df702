// Which parts of a frame the network denoises at once, and with how many components.
//
// Source: Fathom's own. What a tile costs is its arithmetic, that for its borders with it; what it gains by more components
// is what ComponentGains expects of its blocks. Parts of at most 512 pixels a side are cut along the borders of blocks, and shrunk
// to what has work, as far as that lowers cost less gain (the least over all such cuts is found).
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <vector>

#include "nn/compositional.h"

namespace fathom::nn {

struct Tile {
  Window window;
  int components = 1;

  bool operator==(const Tile&) const = default;
};

// What there is to do in a block.
struct BlockWorth {
  bool work = true;              // else no tile need have it
  Window within{};               // of it, all that need be in a tile, at multiples of 4; of no area: the whole block
  std::array<double, 2> gain{};  // see ComponentGains::of
};

struct TileParams {
  // What may be held besides the frame and the result; 0: no limit. Where eight tiles would not fit at once, they are cut to
  // 256 pixels a side; where one would not, to 64 at least.
  size_t memory = 0;
  int least = 1, most = 1;  // components: 1, 2 or 4
  // The part of a block's error that must fall for one more K = 1 of work.
  double gainPerPass = 0.02;
};

inline constexpr int kBlock = 64;  // pixels a side, or what is left of a part

// The tiles of a frame whose sides are multiples of 4. They do not overlap, and have all that has work; which components
// a pixel gets does not depend on the memory. `worth` is called from many threads at once.
std::vector<Tile> planTiles(const CompositionalNet& net, int height, int width, const TileParams& params,
                            const std::function<BlockWorth(const Window& block)>& worth = {});

// What denoising a tile of the plan holds, as CompositionalNet::bytesPerPixel has it.
double bytesOfTile(const CompositionalNet& net, const Tile& tile);

}  // namespace fathom::nn
