// The mathematics of deep samples: what alpha and colour become when a volume is split and when samples coincide.
//
// Source: "Interpreting OpenEXR Deep Pixels", in forms that keep their precision at alpha near 0 and near 1.
// Decide, then apply: these functions see alphas only, and return the weights that every premultiplied channel is
// multiplied with.
#pragma once

#include <cmath>

namespace fathom::deep {

// What compositing makes of an alpha that a file may hold: NaN is 0, and the rest is brought into [0,1].
inline double opacity(float alpha) {
  return alpha > 0 ? (alpha < 1 ? double(alpha) : 1.0) : 0.0;
}

// What compositing makes of a colour: non-finite values and magnitudes above 1e15 are 0.
inline float finiteOrZero(float value) {
  return std::abs(value) <= 1e15f ? value : 0.0f;
}

}  // namespace fathom::deep
