// How bright a frame is: the mean of its light, which absolute constants scale with, but for the few values that are far above
// all others.
//
// A firefly of 1e9, or a sun of 1e5 in a hundredth of the pixels, would be the mean of all the rest. So the largest hundredth of
// the values (or one pixel's) does not count where it is more than a thousand times the mean of the others. Decided by powers
// of two; negative values by their magnitude.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "flat/finite.h"

namespace fathom::flat {

// How far above the others what no renderer means is: for means over a frame that one such pixel would decide.
inline constexpr double kAbsurd = 1e6;

class LevelSum {
 public:
  // What is not finite does not count.
  void add(double value) {
    if (!(std::fabs(value) <= double(kLargest))) return;
    Binade& binade = binades_[binadeOf(value)];
    binade.sum += value;
    binade.magnitude += std::fabs(value);
    ++binade.count;
  }

  // The level; 0.5 where there is nothing, or less than 1e-15.
  float result() const;
  // The mean of what is below limit(farAbove); 0 where there is nothing.
  double mean(double farAbove) const;
  // Magnitudes from this on are of the largest hundredth and more than `farAbove` times the mean of the others; infinite where
  // there are none.
  double limit(double farAbove) const;

 private:
  static constexpr int kBias = 150;  // the least exponent of a denormal is -148
  static constexpr size_t kMost = 256;

  struct Binade {
    double sum = 0, magnitude = 0;
    uint64_t count = 0;
  };

  // What is nothing as a float is nothing here.
  static size_t binadeOf(double value) {
    int exponent = 0;
    if (value != 0) std::frexp(value, &exponent);
    return value == 0 ? 0 : size_t(std::max(exponent + kBias, 0));
  }
  Binade below(size_t end) const;
  size_t endOf(double farAbove) const;

  std::array<Binade, kMost> binades_{};
};

}  // namespace fathom::flat
