#include "deep/volume.h"

#include <algorithm>
#include <cfloat>

namespace fathom::deep {

namespace {

// Opaque samples hide how much of the others there is: they alone count, each as much as the other.
void mergeOpaque(std::span<const double> alphas, std::span<double> weights, std::span<double> shares) {
  const auto opaque = double(std::count(alphas.begin(), alphas.end(), 1.0));
  for (size_t i = 0; i < alphas.size(); ++i) weights[i] = shares[i] = alphas[i] == 1 ? 1 / opaque : 0;
}

// Samples without alpha emit and hide nothing: their colours add up.
void mergeClear(std::span<double> weights, std::span<double> shares) {
  std::fill(weights.begin(), weights.end(), 1.0);
  std::fill(shares.begin(), shares.end(), 1 / double(shares.size()));
}

}  // namespace

Part partOf(double alpha, double fraction) {
  if (alpha == 1) return {1, 1};
  if (alpha <= double(FLT_MIN)) return {fraction * alpha, fraction};
  const double part = -std::expm1(fraction * std::log1p(-alpha));
  return {part, part / alpha};
}

Merged merge(std::span<const double> alphas, std::span<double> weights, std::span<double> shares) {
  double depth = 0;  // optical depth of all
  for (const double a : alphas) depth += -std::log1p(-a);
  Merged merged{-std::expm1(-depth), 0};
  if (std::isinf(depth)) {
    mergeOpaque(alphas, weights, shares);
  } else if (depth == 0) {
    mergeClear(weights, shares);
  } else {
    for (size_t i = 0; i < alphas.size(); ++i) {
      const double own = -std::log1p(-alphas[i]);
      weights[i] = merged.alpha / depth * (alphas[i] == 0 ? 1 : own / alphas[i]);
      shares[i] = own / depth;
    }
  }
  merged.largest = size_t(std::max_element(shares.begin(), shares.end()) - shares.begin());
  return merged;
}

}  // namespace fathom::deep
