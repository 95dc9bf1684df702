// A plane with a border on every side, so that kernels read around a pixel without asking where the image ends.
#pragma once

#include <algorithm>

#include "base/buffer.h"

namespace fathom::flat {

// width x height values with `pad` more on every side and enough on the right for whole vectors and tiles.
class Padded {
 public:
  static constexpr int kSlack = 64;  // a tile may read this far past the right border

  Padded() = default;
  Padded(int width, int height, int pad)
      : width_(width),
        height_(height),
        pad_(pad),
        stride_((width + 2 * pad + kSlack + 15) / 16 * 16),
        values_(size_t(stride_) * size_t(height + 2 * pad)) {}

  float* row(int y) { return values_.data() + ptrdiff_t(y + pad_) * stride_ + pad_; }
  const float* row(int y) const { return values_.data() + ptrdiff_t(y + pad_) * stride_ + pad_; }
  ptrdiff_t stride() const { return stride_; }

  // Repeats the outermost values into the border.
  void extend() {
    for (int y = 0; y < height_; ++y) {
      float* r = row(y);
      std::fill(r - pad_, r, r[0]);
      std::fill(r + width_, r - pad_ + stride_, r[width_ - 1]);
    }
    for (int y = 1; y <= pad_; ++y) {
      std::copy_n(row(0) - pad_, stride_, row(-y) - pad_);
      std::copy_n(row(height_ - 1) - pad_, stride_, row(height_ - 1 + y) - pad_);
    }
  }

 private:
  int width_ = 0, height_ = 0, pad_ = 0;
  ptrdiff_t stride_ = 0;
  Buffer<float> values_;
};

}  // namespace fathom::flat
