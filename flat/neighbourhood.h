// The neighbourhood that the gate and the mix look at, of pixels and of bins: 7x7 pixels, weighted less the farther away.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace fathom::flat {

inline constexpr int kNeighbourRadius = 3;
inline constexpr float kAlikeFloor = 4e-4f;  // of the squared mean colour, in alike-inl.h: 1e-4 where that is 0.5

// exp(-|offset|^2 / 5).
class Reach {
 public:
  Reach() {
    constexpr float kReach = 5;
    for (int i = -kNeighbourRadius; i <= kNeighbourRadius; ++i)
      across_[size_t(i + kNeighbourRadius)] = std::exp(-float(i * i) / kReach);
  }
  float operator()(int dx, int dy) const {
    return across_[size_t(dy + kNeighbourRadius)] * across_[size_t(dx + kNeighbourRadius)];
  }

 private:
  std::array<float, 2 * kNeighbourRadius + 1> across_;
};

// Calls body(x, y) for the pixels around (x, y) that the image has, rows in order, itself among them.
template <class Body>
void forNeighbours(int width, int height, int x, int y, const Body& body) {
  const int x0 = std::max(0, x - kNeighbourRadius), x1 = std::min(width - 1, x + kNeighbourRadius);
  for (int yq = std::max(0, y - kNeighbourRadius); yq <= std::min(height - 1, y + kNeighbourRadius); ++yq)
    for (int xq = x0; xq <= x1; ++xq) body(xq, yq);
}

}  // namespace fathom::flat
