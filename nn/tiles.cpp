#include "nn/tiles.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <vector>

#include "base/parallel.h"
#include "nn/tile_work.h"

namespace fathom::nn {

namespace {

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

void denoiseTiles(const CompositionalNet& net, const CompositionalInput& frame, std::span<const Tile> tiles,
                  const Planes& out, size_t memory, const Progress& progress) {
  double most = 1, all = 0;
  std::vector<double> work;
  for (const Tile& tile : tiles) {
    most = std::max(most, bytesOfTile(net, tile));
    all += work.emplace_back(net.flop(tile.window, frame.height, frame.width, tile.components));
  }
  int threads = tbb::this_task_arena::max_concurrency();
  if (memory) threads = std::clamp(int(std::min(double(memory) / most, 1e6)), 1, threads);
  Workspaces workspaces;
  Done done(all, progress);
  progress.at(0);
  tbb::task_arena arena(threads);
  arena.execute([&] {
    parallelFor(0, int(tiles.size()), [&](int i) {
      const Tile& tile = tiles[size_t(i)];
      auto workspace = workspaces.take();
      net.denoise(frame, tile.window, tile.components, out, *workspace, progress.stop);
      workspaces.giveBack(std::move(workspace));
      done.add(work[size_t(i)]);
    });
  });
  progress.at(1);
}

}  // namespace fathom::nn
