#include "deep/volume.h"

#include <algorithm>
#include <cfloat>

namespace fathom::deep {

namespace {

// Opaque samples hide how much of the others there is: they alone count, each as much as the other.
void mergeOpaque(std::span<const Slice> slices, std::span<double> weights, std::span<double> shares) {
  const auto opaque = double(std::ranges::count(slices, 1.0, &Slice::alpha));
  for (size_t i = 0; i < slices.size(); ++i) weights[i] = shares[i] = slices[i].alpha == 1 ? 1 / opaque : 0;
}

// Samples without alpha emit and hide nothing: their colours add up.
void mergeClear(std::span<const Slice> slices, std::span<double> weights, std::span<double> shares) {
  for (size_t i = 0; i < slices.size(); ++i) weights[i] = slices[i].fraction;
  std::fill(shares.begin(), shares.end(), 1 / double(shares.size()));
}

}  // namespace

Part partOf(const Slice& slice) {
  if (slice.alpha == 1) return {1, 1};
  if (slice.alpha <= double(FLT_MIN)) return {slice.fraction * slice.alpha, slice.fraction};
  const double part = -std::expm1(-slice.fraction * slice.depth);
  return {part, part / slice.alpha};
}

Merged merge(std::span<const Slice> slices, std::span<double> weights, std::span<double> shares) {
  double depth = 0;  // optical depth of all
  for (const Slice& slice : slices) depth += slice.fraction * slice.depth;
  Merged merged{-std::expm1(-depth), 0};
  if (std::isinf(depth)) {
    mergeOpaque(slices, weights, shares);
  } else if (depth == 0) {
    mergeClear(slices, weights, shares);
  } else {
    const double scale = merged.alpha / depth;
    for (size_t i = 0; i < slices.size(); ++i) {
      const Slice& slice = slices[i];
      weights[i] = scale * slice.fraction * (slice.alpha == 0 ? 1 : slice.depth / slice.alpha);
      shares[i] = slice.fraction * slice.depth / depth;
    }
  }
  merged.largest = size_t(std::max_element(shares.begin(), shares.end()) - shares.begin());
  return merged;
}

}  // namespace fathom::deep
