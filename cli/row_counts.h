// Counts of what an operation met, row by row: a chain may come by a row more than once, when an operation behind looks
// at all of it first or needs rows around its own.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <span>

#include "deep/image.h"

namespace fathom::cli {

// May be told by several threads at once.
class RowCounts {
 public:
  // `counts`: of y and the rows below it; what was known of them is replaced.
  template <class T>
  void set(int y, std::span<const T> counts) {
    const std::lock_guard lock(mutex_);
    for (const T count : counts) counts_[y++] = count;
  }
  void setSamples(const deep::DeepImage& image) {
    const Box& window = image.dataWindow;
    const std::lock_guard lock(mutex_);
    for (int y = window.y0; y < window.y1; ++y) {
      const size_t first = window.index(window.x0, y);
      counts_[y] = image.offsets[first + size_t(window.width())] - image.offsets[first];
    }
  }
  uint64_t total() const {
    const std::lock_guard lock(mutex_);
    uint64_t sum = 0;
    for (const auto& [y, count] : counts_) sum += count;
    return sum;
  }

 private:
  mutable std::mutex mutex_;
  std::map<int, uint64_t> counts_;
};

}  // namespace fathom::cli
