// Planes of floats that somebody else owns.
#pragma once

#include <cstddef>
#include <vector>

namespace fathom::nn {

// Row y of plane p begins at plane[p] + y * stride.
template <class T>
struct PlanesOf {
  std::vector<T*> plane;
  ptrdiff_t stride = 0;

  // The same planes, seen from pixel (x, y).
  PlanesOf at(int x, int y) const {
    PlanesOf result = *this;
    for (T*& p : result.plane) p += y * stride + x;
    return result;
  }
  T* row(size_t p, int y) const { return plane[p] + y * stride; }
};

using Planes = PlanesOf<float>;
using ConstPlanes = PlanesOf<const float>;

// `count` planes of height x width that lie one after another.
template <class T>
PlanesOf<T> denseRows(T* first, int count, int height, int width) {
  PlanesOf<T> result{{}, width};
  for (int p = 0; p < count; ++p) result.plane.push_back(first + size_t(p) * size_t(height) * size_t(width));
  return result;
}

}  // namespace fathom::nn
