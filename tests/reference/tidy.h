// Tidying and flattening one deep pixel in long double, straight from the formulas of "Interpreting OpenEXR Deep
// Pixels": every volume is cut at every depth first, then all pieces are compared with each other. For alphas of 0, 1,
// and not near either.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/reference/deep_samples.h"

namespace fathom::reference {

struct Piece {
  long double z, zBack, alpha, colour;
  bool operator<(const Piece& other) const { return z < other.z || (z == other.z && zBack < other.zBack); }
};

inline Piece cutOut(const Sample& sample, long double from, long double to) {
  const long double x = (to - from) / ((long double)(sample.zBack) - sample.z), a = sample.alpha;
  if (a == 1) return {from, to, 1, sample.colour};
  if (a == 0) return {from, to, 0, x * sample.colour};
  const long double part = 1 - std::pow(1 - a, x);
  return {from, to, part, part / a * sample.colour};
}

inline Piece merged(const std::vector<Piece>& pieces) {
  Piece result{pieces[0].z, pieces[0].zBack, 0, 0};
  long double opaque = 0, passed = 1, optical = 0;
  for (const Piece& piece : pieces) {
    if (piece.alpha == 1) result.colour += piece.colour, opaque += 1;
    passed *= 1 - piece.alpha;
  }
  result.alpha = 1 - passed;
  if (opaque > 0) {
    result.colour /= opaque;
    return result;
  }
  for (const Piece& piece : pieces) {
    const long double u = -std::log(1 - piece.alpha);
    result.colour += piece.alpha == 0 ? piece.colour : piece.colour * u / piece.alpha;
    optical += u;
  }
  if (optical > 0) result.colour *= result.alpha / optical;
  return result;
}

inline std::vector<Piece> tidy(const std::vector<Sample>& samples) {
  std::vector<long double> cuts;
  for (const Sample& sample : samples) cuts.insert(cuts.end(), {sample.z, sample.zBack});
  std::sort(cuts.begin(), cuts.end());
  std::vector<Piece> cut;
  for (const Sample& sample : samples) {
    if (sample.zBack <= sample.z) {
      cut.push_back({sample.z, sample.z, sample.alpha, sample.colour});
      continue;
    }
    long double from = sample.z;
    for (const long double to : cuts)
      if (to > from && to <= sample.zBack) {
        cut.push_back(cutOut(sample, from, to));
        from = to;
      }
  }
  std::stable_sort(cut.begin(), cut.end());
  std::vector<Piece> result;
  for (size_t i = 0; i < cut.size();) {
    std::vector<Piece> same;
    const Piece first = cut[i];
    while (i < cut.size() && !(first < cut[i])) same.push_back(cut[i++]);
    result.push_back(same.size() == 1 ? first : merged(same));
  }
  return result;
}

// Colour and alpha of tidy pieces, composited.
inline Piece flatten(const std::vector<Piece>& pieces) {
  Piece result{0, 0, 0, 0};
  long double passed = 1;
  for (const Piece& piece : pieces) {
    result.colour += passed * piece.colour;
    result.alpha += passed * piece.alpha;
    passed *= 1 - piece.alpha;
  }
  return result;
}

}  // namespace fathom::reference
