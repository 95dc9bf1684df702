#include "deep/mean_level.h"

#include "deep/flatten.h"
#include "flat/finite.h"

namespace fathom::deep {

void MeanLevel::add(const DeepImage& rows) {
  constexpr std::array<const char*, 3> kRgb{"R", "G", "B"};
  const flat::Image flattened = flatten(rows);
  const flat::Plane& alpha = flattened.get("A");
  for (size_t c = 0; c < kRgb.size(); ++c) {
    const flat::Plane& plane = flattened.get(kRgb[c]);
    for (size_t i = 0; i < plane.values.size(); ++i) {
      if (!(alpha.values[i] > 0) || !isFinite(plane.values[i])) continue;
      sums_[c] += double(plane.values[i]);
      ++count_;
    }
  }
}

float MeanLevel::value() const {
  const double mean = count_ ? (sums_[0] + sums_[1] + sums_[2]) / double(count_) : 0;
  return mean > 1e-20 && mean < double(kLargest) ? float(mean) : 0.5f;
}

}  // namespace fathom::deep
