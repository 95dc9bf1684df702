// A function of one number as a table: straight lines between points that lie evenly in each octave.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace fathom::flat {

// What a screen can show of it: values below 0 count as 0, values above 1 as 1. Holds for arguments in [-kMost, kMost],
// the range of HALF. Read from any number of threads.
class CurveTable {
 public:
  static constexpr float kMost = 65504;

  // `evaluate` replaces arguments, up to 2^16 to both sides, by the function's values; it is called once. No table where
  // the middle of some line is off by more than `tolerance` or no number: where the function jumps or bends too much. A
  // function that is smooth but for single kinks is met everywhere within twice the tolerance.
  static std::optional<CurveTable> make(const std::function<void(std::span<float>)>& evaluate, float tolerance);

  // In [0,1].
  float operator()(float x) const {
    const uint32_t place = std::bit_cast<uint32_t>(std::abs(x) + kBias) - kFirst;
    const float* from = values_.data() + (std::signbit(x) ? kPoints : 0) + (place >> kRest);
    const float along = float(int32_t(place & ((1u << kRest) - 1))) * (1.0f / (1u << kRest));
    return std::min(std::max(0.0f, from[0] + along * (from[1] - from[0])), 1.0f);
  }

 private:
  // The octaves are those of |x| + kBias, so that the first one begins at 0.
  static constexpr float kBias = 0x1p-32f;
  static constexpr uint32_t kFirst = std::bit_cast<uint32_t>(kBias);
  static constexpr int kRest = 16;                              // bits of a place between two points
  static constexpr int kPoints = 48 * (1 << (23 - kRest)) + 1;  // of a sign, up to 2^16

  std::vector<float> values_;  // at the points of positive numbers, then at those of negative ones
};

}  // namespace fathom::flat
