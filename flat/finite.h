// Which values are numbers to work with: DATA.md counts magnitudes above 1e15 as non-finite.
#pragma once

#include <cmath>

namespace fathom {

inline constexpr float kLargest = 1e15f;

// False for NaN, too.
inline bool isFinite(float value) {
  return std::abs(value) <= kLargest;
}
inline float finiteOrZero(float value) {
  return isFinite(value) ? value : 0.0f;
}

}  // namespace fathom
