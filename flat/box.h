// A half-open window of pixels. EXR windows are inclusive: deep/io and flat/io convert.
#pragma once

#include <algorithm>
#include <cstddef>

namespace fathom {

struct Box {
  int x0 = 0, y0 = 0;  // first column and row inside
  int x1 = 0, y1 = 0;  // first column and row outside

  int width() const { return std::max(0, x1 - x0); }
  int height() const { return std::max(0, y1 - y0); }
  size_t area() const { return size_t(width()) * size_t(height()); }
  bool empty() const { return area() == 0; }
  bool contains(int x, int y) const { return x >= x0 && x < x1 && y >= y0 && y < y1; }
  // The pixel's place in row order.
  size_t index(int x, int y) const { return size_t(y - y0) * size_t(width()) + size_t(x - x0); }
  bool operator==(const Box&) const = default;
};

inline Box intersect(const Box& a, const Box& b) {
  return {std::max(a.x0, b.x0), std::max(a.y0, b.y0), std::min(a.x1, b.x1), std::min(a.y1, b.y1)};
}

inline Box moved(const Box& box, int x, int y) {
  return {box.x0 + x, box.y0 + y, box.x1 + x, box.y1 + y};
}

// The smallest that holds both; an empty one counts for nothing.
inline Box unionOf(const Box& a, const Box& b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  return {std::min(a.x0, b.x0), std::min(a.y0, b.y0), std::max(a.x1, b.x1), std::max(a.y1, b.y1)};
}

}  // namespace fathom
