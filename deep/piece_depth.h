// The optical depth of a piece of a pixel, from its samples: its alpha does not tell it where that is near 1, and rounds to
// 1 where several are thick together, though nothing of it is opaque.
#pragma once

#include "deep/pixel_pieces.h"

namespace fathom::deep {

// Spans are the pixel's; `zBack` may be empty. Infinite where one of the samples is opaque.
inline double opticalDepthOf(const Piece& piece, std::span<const float> alpha, std::span<const float> z,
                             std::span<const float> zBack) {
  double depth = 0;
  for (const Share& share : piece.shares) {
    const size_t s = share.sample;
    const Range whole = usableRange(z[s], zBack.empty() ? z[s] : zBack[s]);
    const double length = double(piece.range.zBack) - double(piece.range.z);
    const double fraction = whole == piece.range ? 1 : length / (double(whole.zBack) - double(whole.z));
    depth += fraction * opticalDepth(opacity(alpha[s]));
  }
  return depth;
}

}  // namespace fathom::deep
