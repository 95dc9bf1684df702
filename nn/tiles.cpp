#include "nn/tiles.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>

#include "base/parallel.h"
#include "nn/tile_work.h"

namespace fathom::nn {

namespace {

constexpr int kSmallest = 64, kFair = 256, kLargest = 512;
constexpr double kTogether = 8;  // tiles that should fit into the memory at once, as long as they stay fair

double bytesOfTile(const CompositionalNet& net, int side, int components) {
  const double whole = side + 2 * net.halo(components);
  return net.bytesPerPixel(components) * whole * whole;
}

int tileSide(const CompositionalNet& net, int components, const TileParams& params) {
  int side = kLargest;
  const auto tooLarge = [&](double tiles) {
    return params.memory && tiles * bytesOfTile(net, side, components) > double(params.memory);
  };
  while (side > kFair && tooLarge(kTogether)) side -= kTileStep;
  while (side > kSmallest && tooLarge(1)) side -= kTileStep;
  return side;
}

// Workspaces, each used by one tile at a time.
class Workspaces {
 public:
  std::unique_ptr<CompositionalNet::Workspace> take() {
    const std::lock_guard lock(guard_);
    if (free_.empty()) return std::make_unique<CompositionalNet::Workspace>();
    auto workspace = std::move(free_.back());
    free_.pop_back();
    return workspace;
  }
  void giveBack(std::unique_ptr<CompositionalNet::Workspace> workspace) {
    const std::lock_guard lock(guard_);
    free_.push_back(std::move(workspace));
  }

 private:
  std::mutex guard_;
  std::vector<std::unique_ptr<CompositionalNet::Workspace>> free_;
};

}  // namespace

std::vector<Window> tilesOf(const CompositionalNet& net, int height, int width, int mostComponents,
                            const TileParams& params) {
  return tilesOf(height, width, tileSide(net, mostComponents, params));
}

void denoiseTiles(const CompositionalNet& net, const CompositionalInput& frame, int mostComponents,
                  const std::function<int(const Window& tile)>& components, const Planes& out, const TileParams& params,
                  const Progress& progress) {
  const std::vector<Window> tiles = tilesOf(net, frame.height, frame.width, mostComponents, params);
  int threads = tbb::this_task_arena::max_concurrency();
  if (params.memory) {
    const double perTile = bytesOfTile(net, tileSide(net, mostComponents, params), mostComponents);
    threads = std::clamp(int(double(params.memory) / perTile), 1, threads);
  }
  Workspaces workspaces;
  Done done(double(frame.height) * frame.width, progress);
  progress.at(0);
  tbb::task_arena arena(threads);
  arena.execute([&] {
    parallelFor(0, int(tiles.size()), [&](int i) {
      const Window& tile = tiles[size_t(i)];
      if (progress.stop.stop_requested()) throw Cancelled();
      if (const int count = components(tile)) {
        auto workspace = workspaces.take();
        net.denoise(frame, tile, count, out, *workspace, progress.stop);
        workspaces.giveBack(std::move(workspace));
      }
      done.add(double(tile.width) * tile.height);
    });
  });
}

}  // namespace fathom::nn
