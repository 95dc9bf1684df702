// A function of one number as a table: straight lines between points that lie evenly in each octave.
#pragma once

#include <array>
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
  float operator()(float x) const;

  // At the points of positive numbers, then at those of negative ones.
  std::span<const float> values() const { return values_; }

 private:
  std::vector<float> values_;
};

// Opaque pixels 0xffRRGGBB: a function for each channel, the value times 255, rounded.
void lookUpPixels(const std::array<const CurveTable*, 3>& tables, const std::array<const float*, 3>& rgb, size_t pixels,
                  uint32_t* to);

}  // namespace fathom::flat
