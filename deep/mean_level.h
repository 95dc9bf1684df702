// The brightness of a frame, which absolute constants scale with.
#pragma once

#include <array>
#include <cstddef>

#include "deep/image.h"

namespace fathom::deep {

// The mean of the flattened R, G and B over the pixels with alpha, from finite values, of a frame that comes in bands of rows
// from the top: the same bits however it is cut.
class MeanLevel {
 public:
  void add(const DeepImage& rows);
  float value() const;  // 0.5 where there is none

 private:
  std::array<double, 3> sums_{};
  size_t count_ = 0;
};

}  // namespace fathom::deep
