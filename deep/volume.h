// The mathematics of deep samples: what alpha and colour become when a volume is split and when samples coincide.
//
// Source: "Interpreting OpenEXR Deep Pixels", in forms that keep their precision at alpha near 0 and near 1.
// Decide, then apply: these functions see alphas only, and return the weights that every premultiplied channel is
// multiplied with.
#pragma once

#include <cmath>
#include <limits>
#include <span>

#include "flat/finite.h"

namespace fathom::deep {

// What compositing makes of an alpha that a file may hold: NaN is 0, and the rest is brought into [0,1].
inline double opacity(float alpha) {
  const float positive = alpha > 0 ? alpha : 0.0f;
  return double(positive < 1 ? positive : 1.0f);
}

// Depths as compositing takes them. A range that is not finite or not positive in length is a point at `z`; a depth
// that is not a number is a point behind everything.
struct Range {
  float z, zBack;  // z == zBack: a point

  bool isPoint() const { return z == zBack; }
  double middle() const { return (double(z) + double(zBack)) / 2; }
  bool operator==(const Range&) const = default;
};
inline Range usableRange(float z, float zBack) {
  const float end = zBack > z ? zBack : z;
  if (std::isfinite(z) && std::isfinite(end)) return {z, end};
  const float point = std::isnan(z) ? std::numeric_limits<float>::infinity() : z;
  return {point, point};
}

// How much a sample of `alpha`, in [0,1], dims what is behind it: -ln(1 - alpha), infinite for an opaque one.
inline double opticalDepth(double alpha) {
  return -std::log1p(-alpha);
}

// A part of a volume: its alpha, and the factor between the whole's premultiplied values and the part's.
struct Part {
  double alpha, weight;
};

// A sample as far as it covers some depths: the whole's alpha and optical depth, and what fraction of its length it is.
struct Slice {
  double alpha, depth, fraction;
};

// Parts of fractions that sum to 1, front over back, give the volume again.
Part partOf(const Slice& slice);
inline Part partOf(double alpha, double fraction) {
  return partOf({alpha, opticalDepth(alpha), fraction});
}

// What coincident samples become together.
struct Merged {
  double alpha;
  size_t largest;  // which of them has the largest share; the first where several have
};

// Merges slices that cover the same depths. `weights` receives the factors of the whole samples' premultiplied values,
// whose sum is the merged sample's; `shares` receives what part of its opacity each one makes up (sum 1). All spans have
// the same size, at least 1.
Merged merge(std::span<const Slice> slices, std::span<double> weights, std::span<double> shares);

}  // namespace fathom::deep
