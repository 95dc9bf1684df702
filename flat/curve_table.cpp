#include "flat/curve_table.h"

namespace fathom::flat {

std::optional<CurveTable> CurveTable::make(const std::function<void(std::span<float>)>& evaluate, float tolerance) {
  // Points and, between them, the middles of lines; of positive numbers and then of negative ones.
  constexpr size_t kBoth = 2 * size_t(kPoints) - 1;
  std::vector<float> values(2 * kBoth);
  for (size_t i = 0; i < kBoth; ++i) {
    values[i] = std::bit_cast<float>(kFirst + (uint32_t(i) << (kRest - 1))) - kBias;
    values[kBoth + i] = -values[i];
  }
  evaluate(values);
  for (float& value : values) value = std::clamp(value, -1.0f, 2.0f);  // NaN stays
  CurveTable table;
  table.values_.reserve(2 * size_t(kPoints));
  for (const size_t sign : {size_t(0), kBoth}) {
    const float* at = values.data() + sign;
    for (size_t i = 0; i < kBoth; i += 2) table.values_.push_back(at[i]);
    for (size_t i = 1; i < kBoth; i += 2) {
      const float line = 0.5f * (at[i - 1] + at[i + 1]);
      if (!(std::abs(std::clamp(line, 0.0f, 1.0f) - std::clamp(at[i], 0.0f, 1.0f)) <= tolerance)) return {};
    }
  }
  return table;
}

}  // namespace fathom::flat
