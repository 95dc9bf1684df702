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

inline Window scaled(const Window& window, int scale) {
  return {window.x >> scale, window.y >> scale, window.width >> scale, window.height >> scale};
}

// Of a tile of a frame of height x width, what lies within `reach` of any pixel that `there` tells of, at multiples of `step`.
template <class There>
Window near(const Window& tile, int reach, int height, int width, int step, const There& there) {
  const Window around = grown(tile, reach, height, width);
  int x0 = around.x + around.width, y0 = around.y + around.height, x1 = around.x, y1 = around.y;
  for (int y = around.y; y < around.y + around.height; ++y) {
    int first = around.x, last = around.x + around.width;
    while (first < last && !there(first, y)) ++first;
    if (first == last) continue;
    while (!there(last - 1, y)) --last;
    x0 = std::min(x0, first), x1 = std::max(x1, last);
    y0 = std::min(y0, y), y1 = y + 1;
  }
  if (x0 >= x1) return {};
  x0 = std::max(tile.x, (x0 - reach) / step * step), y0 = std::max(tile.y, (y0 - reach) / step * step);
  x1 = std::min(tile.x + tile.width, (x1 + reach + step - 1) / step * step);
  y1 = std::min(tile.y + tile.height, (y1 + reach + step - 1) / step * step);
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
