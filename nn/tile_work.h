// What all that works on a frame in tiles has in common.
#pragma once

#include <algorithm>
#include <mutex>
#include <vector>

#include "base/progress.h"
#include "nn/blocked.h"

namespace fathom::nn {

inline constexpr int kTileStep = 32;

// Where to cut a length into parts of about equal length, at most `most`, each but the last a multiple of kTileStep.
inline std::vector<int> cuts(int length, int most) {
  const int parts = (length + most - 1) / most;
  const int part = parts ? ((length + parts - 1) / parts + kTileStep - 1) / kTileStep * kTileStep : 0;
  std::vector<int> result = {0};
  while (result.back() < length) result.push_back(std::min(result.back() + part, length));
  return result;
}

// A rectangle of height x width pixels in tiles of at most `side`, in rows.
inline std::vector<Window> tilesOf(int height, int width, int side) {
  const std::vector<int> xs = cuts(width, side), ys = cuts(height, side);
  std::vector<Window> tiles;
  for (size_t j = 0; j + 1 < ys.size(); ++j)
    for (size_t i = 0; i + 1 < xs.size(); ++i) tiles.push_back({xs[i], ys[j], xs[i + 1] - xs[i], ys[j + 1] - ys[j]});
  return tiles;
}

// A window with `halo` more around it, as far as there is a frame of height x width.
inline Window grown(const Window& window, int halo, int height, int width) {
  const int x0 = std::max(window.x - halo, 0), y0 = std::max(window.y - halo, 0);
  const int x1 = std::min(window.x + window.width + halo, width),
            y1 = std::min(window.y + window.height + halo, height);
  return {x0, y0, x1 - x0, y1 - y0};
}

inline size_t area(const Window& window) {
  return size_t(window.width) * size_t(window.height);
}

// Counts what is done, from any thread.
class Done {
 public:
  Done(double all, const Progress& progress) : all_(all), progress_(progress) {}

  void add(double part) {
    const std::lock_guard lock(guard_);
    sum_ += part;
    progress_.at(std::min(sum_ / all_, 1.0));
  }

 private:
  double all_, sum_ = 0;
  const Progress& progress_;
  std::mutex guard_;
};

}  // namespace fathom::nn
