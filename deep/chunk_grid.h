// How the pixels of a deep part are cut into chunks: rows of pixels, or the tiles of level 0.
#pragma once

#include <algorithm>
#include <cstdint>

#include "deep/io.h"
#include "flat/box.h"

namespace fathom::deep {

struct ChunkGrid {
  Box window;
  int width = 0, height = 0;  // of a chunk; the last ones are cut off at the window's edge

  int columns() const { return (window.width() - 1) / width + 1; }
  int rows() const { return (window.height() - 1) / height + 1; }
  // The row of chunks that a row of pixels is in.
  int rowOf(int y) const { return (y - window.y0) / height; }
  Box box(int column, int row) const {
    const int64_t x = int64_t(window.x0) + int64_t(column) * width, y = int64_t(window.y0) + int64_t(row) * height;
    return {int(x), int(y), int(std::min<int64_t>(window.x1, x + width)),
            int(std::min<int64_t>(window.y1, y + height))};
  }
  // The band of all chunks that a band of pixels touches.
  Box covering(const Box& band) const {
    if (band.height() == 0) return band;
    return {window.x0, box(0, rowOf(band.y0)).y0, window.x1, box(0, rowOf(band.y1 - 1)).y1};
  }
  // The bytes of a whole chunk's table of sample counts, before packing.
  size_t tableBytes() const { return 4 * size_t(width) * size_t(height); }
};

inline ChunkGrid gridOf(const PartInfo& part) {
  if (part.tiled) return {part.dataWindow, part.tileWidth, part.tileHeight};
  return {part.dataWindow, part.dataWindow.width(), 1};
}

}  // namespace fathom::deep
