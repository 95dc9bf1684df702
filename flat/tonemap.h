// From scene-linear values to what a display shows.
#pragma once

#include <cmath>

namespace fathom::flat {

// The sRGB transfer curve on [0,1]; below 0 and NaN give 0, above 1 gives 1.
inline double srgb(double linear) {
  if (!(linear > 0)) return 0;
  if (linear >= 1) return 1;
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

// x / (1 + x), then sRGB: every non-negative value stays distinguishable, the brightest tends to 1.
inline double toneMap(double linear) {
  return linear > 0 ? srgb(std::isinf(linear) ? 1 : linear / (1 + linear)) : 0;
}

}  // namespace fathom::flat
