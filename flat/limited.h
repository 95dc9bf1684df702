// Results that end where values would count as non-finite.
#pragma once

#include <algorithm>

#include "flat/finite.h"

namespace fathom {

// What is too large ends at the largest magnitude, instead of being no number from there on.
inline float limited(double value) {
  return float(std::clamp(value, -double(kLargest), double(kLargest)));
}

}  // namespace fathom
