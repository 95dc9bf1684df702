#include "nn/tile_plan.h"

#include <algorithm>
#include <limits>
#include <map>
#include <tuple>

#include "base/parallel.h"
#include "nn/tile_work.h"

namespace fathom::nn {

namespace {

constexpr int kSmallest = 64, kFair = 256, kLargest = 512;
constexpr double kTogether = 8;     // tiles that should fit into the memory at once, as long as they stay fair
constexpr double kTileCost = 2000;  // of a tile beside its arithmetic, in pixels with K = 1
constexpr std::array<int, 3> kComponents = {1, 2, 4};

double bytesOfSides(const CompositionalNet& net, int width, int height, int components) {
  const double halo = 2.0 * net.halo(components);
  return net.bytesPerPixel(components) * (width + halo) * (height + halo);
}

int tileSide(const CompositionalNet& net, int components, size_t memory) {
  int side = kLargest;
  const auto tooLarge = [&](double tiles) {
    return memory && tiles * bytesOfSides(net, side, side, components) > double(memory);
  };
  while (side > kFair && tooLarge(kTogether)) side -= kTileStep;
  while (side > kSmallest && tooLarge(1)) side -= kTileStep;
  return side;
}

std::vector<Window> cut(const Window& window, int side) {
  const std::vector<int> xs = cuts(window.width, side), ys = cuts(window.height, side);
  std::vector<Window> result;
  for (size_t j = 0; j + 1 < ys.size(); ++j)
    for (size_t i = 0; i + 1 < xs.size(); ++i)
      result.push_back({window.x + xs[i], window.y + ys[j], xs[i + 1] - xs[i], ys[j + 1] - ys[j]});
  return result;
}

// Blocks [x0, x1) x [y0, y1) of a part.
struct Blocks {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  bool empty() const { return x0 >= x1 || y0 >= y1; }
  bool operator<(const Blocks& other) const {
    return std::tie(x0, y0, x1, y1) < std::tie(other.x0, other.y0, other.x1, other.y1);
  }
};

// A part of a frame and what its blocks are worth; finds the cheapest way to cut it.
class Part {
 public:
  Part(const CompositionalNet& net, int height, int width, const TileParams& params, const Window& window)
      : net_(net),
        height_(height),
        width_(width),
        params_(params),
        window_(window),
        across_((window.width + kBlock - 1) / kBlock),
        down_((window.height + kBlock - 1) / kBlock),
        worth_(size_t(across_) * size_t(down_)) {
    for (int i = 0; i < blocks(); ++i) setWorth(i, {});
  }

  int blocks() const { return across_ * down_; }

  Window blockAt(int i) const { return pixelsOf({i % across_, i / across_, i % across_ + 1, i / across_ + 1}); }
  void setWorth(int i, const BlockWorth& worth) {
    worth_[size_t(i)] = worth;
    if (area(worth.within) == 0) worth_[size_t(i)].within = blockAt(i);
  }

  void plan(std::vector<Tile>& tiles) {
    const Blocks all = withWork({0, 0, across_, down_});
    if (!all.empty()) collect(all, tiles);
  }

 private:
  // The cheapest way for some blocks: as one tile, or cut at a place along an axis.
  struct Way {
    double cost = std::numeric_limits<double>::infinity();
    int components = 0;  // 0: cut
    Blocks first, second;
  };

  const BlockWorth& worthAt(int x, int y) const { return worth_[size_t(y) * size_t(across_) + size_t(x)]; }

  Window pixelsOf(const Blocks& blocks) const {
    const int x0 = blocks.x0 * kBlock, y0 = blocks.y0 * kBlock;
    const int x1 = std::min(blocks.x1 * kBlock, window_.width), y1 = std::min(blocks.y1 * kBlock, window_.height);
    return {window_.x + x0, window_.y + y0, x1 - x0, y1 - y0};
  }

  // The smallest window around all that has work in some blocks.
  Window windowOf(const Blocks& blocks) const {
    const Window all = pixelsOf(blocks);
    int x0 = all.x + all.width, y0 = all.y + all.height, x1 = all.x, y1 = all.y;
    for (int y = blocks.y0; y < blocks.y1; ++y)
      for (int x = blocks.x0; x < blocks.x1; ++x) {
        const auto& [work, within, gain] = worthAt(x, y);
        if (!work) continue;
        x0 = std::min(x0, within.x), y0 = std::min(y0, within.y);
        x1 = std::max(x1, within.x + within.width), y1 = std::max(y1, within.y + within.height);
      }
    return {x0, y0, x1 - x0, y1 - y0};
  }

  // The smallest rectangle around those of the blocks that have work.
  Blocks withWork(const Blocks& blocks) const {
    Blocks result{blocks.x1, blocks.y1, blocks.x0, blocks.y0};
    for (int y = blocks.y0; y < blocks.y1; ++y)
      for (int x = blocks.x0; x < blocks.x1; ++x)
        if (worthAt(x, y).work)
          result = {std::min(result.x0, x), std::min(result.y0, y), std::max(result.x1, x + 1),
                    std::max(result.y1, y + 1)};
    return result.empty() ? Blocks{} : result;
  }

  // What components gain over K = 1, in pixels of K = 1.
  double gainOf(const Blocks& blocks, int components) const {
    double sum = 0;
    for (int y = blocks.y0; components > 1 && y < blocks.y1; ++y)
      for (int x = blocks.x0; x < blocks.x1; ++x) {
        const BlockWorth& worth = worthAt(x, y);
        if (worth.work) sum += worth.gain[size_t(components / 4)] * double(area(worth.within));
      }
    return sum / params_.gainPerPass;
  }

  Way asOneTile(const Blocks& blocks) const {
    Way best;
    for (const int components : kComponents) {
      if (components < params_.least || components > params_.most) continue;
      const double work = net_.flop(windowOf(blocks), height_, width_, components) / net_.flopPerPixel(1);
      const double cost = kTileCost + work - gainOf(blocks, components);
      if (cost < best.cost) best = {cost, components, {}, {}};
    }
    return best;
  }

  // Of blocks that withWork gave: there is work on both sides.
  void tryCut(Blocks first, Blocks second, Way& best) {
    first = withWork(first);
    second = withWork(second);
    const double cost = wayOf(first).cost + wayOf(second).cost;
    if (cost < best.cost) best = {cost, 0, first, second};
  }

  const Way& wayOf(const Blocks& blocks) {
    if (const auto found = ways_.find(blocks); found != ways_.end()) return found->second;
    Way best = asOneTile(blocks);
    for (int x = blocks.x0 + 1; x < blocks.x1; ++x)
      tryCut({blocks.x0, blocks.y0, x, blocks.y1}, {x, blocks.y0, blocks.x1, blocks.y1}, best);
    for (int y = blocks.y0 + 1; y < blocks.y1; ++y)
      tryCut({blocks.x0, blocks.y0, blocks.x1, y}, {blocks.x0, y, blocks.x1, blocks.y1}, best);
    return ways_.emplace(blocks, best).first->second;
  }

  void collect(const Blocks& blocks, std::vector<Tile>& tiles) {
    const Way& way = wayOf(blocks);
    if (way.components) {
      tiles.push_back({windowOf(blocks), way.components});
      return;
    }
    collect(way.first, tiles);
    collect(way.second, tiles);
  }

  const CompositionalNet& net_;
  int height_, width_;
  const TileParams& params_;
  Window window_;
  int across_, down_;
  std::vector<BlockWorth> worth_;
  std::map<Blocks, Way> ways_;
};

}  // namespace

std::vector<Tile> planTiles(const CompositionalNet& net, int height, int width, const TileParams& params,
                            const std::function<BlockWorth(const Window& block)>& worth) {
  std::vector<Part> parts;
  std::vector<std::pair<size_t, int>> blocks;  // of which part, and which of it
  for (const Window& window : cut({0, 0, width, height}, kLargest)) {
    parts.emplace_back(net, height, width, params, window);
    for (int i = 0; i < parts.back().blocks(); ++i) blocks.emplace_back(parts.size() - 1, i);
  }
  if (worth)
    parallelFor(0, int(blocks.size()), [&](int b) {
      const auto& [part, i] = blocks[size_t(b)];
      parts[part].setWorth(i, worth(parts[part].blockAt(i)));
    });
  std::vector<std::vector<Tile>> planned(parts.size());
  parallelFor(0, int(parts.size()), [&](int i) { parts[size_t(i)].plan(planned[size_t(i)]); });
  std::vector<Tile> result;
  for (const std::vector<Tile>& tiles : planned)
    for (const Tile& tile : tiles)
      for (const Window& window : cut(tile.window, tileSide(net, tile.components, params.memory)))
        result.push_back({window, tile.components});
  return result;
}

double bytesOfTile(const CompositionalNet& net, const Tile& tile) {
  return bytesOfSides(net, tile.window.width, tile.window.height, tile.components);
}

}  // namespace fathom::nn
