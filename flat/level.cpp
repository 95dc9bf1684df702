#include "flat/level.h"

#include <algorithm>
#include <limits>

namespace fathom::flat {

namespace {

constexpr double kFarAbove = 1000;
constexpr double kDarkest = 1e-15;            // of which a hundred-thousandth of the square still is a normal float
constexpr uint64_t kFewest = 3, kPart = 100;  // at most a hundredth of the values, or three

}  // namespace

LevelSum::Binade LevelSum::below(size_t end) const {
  Binade all;
  for (size_t i = 0; i < end; ++i) {
    all.sum += binades_[i].sum;
    all.magnitude += binades_[i].magnitude;
    all.count += binades_[i].count;
  }
  return all;
}

// The first binade that does not count.
size_t LevelSum::endOf(double farAbove) const {
  uint64_t left = std::max(kFewest, below(kMost).count / kPart);
  size_t others = kMost;
  while (others > 0 && binades_[others - 1].count <= left) left -= binades_[--others].count;
  const Binade rest = below(others);
  if (!(rest.magnitude > 0)) return kMost;
  const double most = farAbove * rest.magnitude / double(rest.count);
  size_t end = others;
  while (end < kMost && std::ldexp(0.5, int(end) - kBias) <= most) ++end;
  return below(end).count < below(kMost).count ? end : kMost;
}

double LevelSum::limit(double farAbove) const {
  const size_t end = endOf(farAbove);
  return end == kMost ? std::numeric_limits<double>::infinity() : std::ldexp(0.5, int(end) - kBias);
}

double LevelSum::mean(double farAbove) const {
  const Binade counted = below(endOf(farAbove));
  return counted.count ? counted.sum / double(counted.count) : 0;
}

float LevelSum::result() const {
  const double level = mean(kFarAbove);
  return level > kDarkest && level < double(kLargest) ? float(level) : 0.5f;
}

}  // namespace fathom::flat
