#include "deep/ops/axis_map.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace fathom::deep {

namespace {

// Positions closer to a whole number are taken for it: they are off by rounding alone.
constexpr double kFuzz = 1e-9;

bool isWhole(double value) {
  return value == std::floor(value);
}

int wholeBelow(double value) {
  return int(std::floor(value + kFuzz));
}

int wholeAbove(double value) {
  return int(std::ceil(value - kFuzz));
}

// Half the width of the tent, in columns of the source.
double radius(const AxisMap& map) {
  return std::max(1.0, map.num / map.den);
}

double weightOf(const AxisMap& map, Filter filter, int column, int source) {
  const double low = map.source(column), high = map.source(column + 1.0);
  if (filter == Filter::Box) return (std::min(high, source + 1.0) - std::max(low, double(source))) / (high - low);
  return 1 - std::abs(source + 0.5 - (low + high) / 2) / radius(map);
}

}  // namespace

bool AxisMap::isWholeMove() const {
  return num == den && isWhole(result(0));
}

bool AxisMap::copies() const {
  return isWhole(den / num) && isWhole(result(0));
}

Extent resultOf(const AxisMap& map, Extent source) {
  const double begin = map.result(source.begin), end = map.result(source.end);
  if (!(std::abs(begin) < 1e9 && std::abs(end) < 1e9))
    fail("expected an image within a billion pixels, found one from {} to {}", begin, end);
  const int first = wholeBelow(begin);
  return {first, source.begin < source.end ? std::max(first, wholeAbove(end)) : first};
}

Extent neededBy(const AxisMap& map, Filter filter, Extent result) {
  const double beyond = filter == Filter::Box ? 0 : radius(map) + 1;
  return {wholeBelow(map.source(result.begin) - beyond), wholeAbove(map.source(result.end) + beyond)};
}

Cover::Cover(const AxisMap& map, Filter filter, Extent source, Extent result) : begin_(result.begin) {
  for (int column = result.begin; column < result.end; ++column) {
    const Extent needed = neededBy(map, filter, {column, column + 1});
    Span span{source.begin, uint32_t(weights_.size()), 0};
    double sum = 0;
    for (int i = std::max(needed.begin, source.begin); i < std::min(needed.end, source.end); ++i) {
      const double weight = weightOf(map, filter, column, i);
      if (weight < kFuzz) continue;
      if (span.count++ == 0) span.first = i;
      weights_.push_back(weight);
      sum += weight;
    }
    // An edge that is off by rounding alone is none.
    if (filter == Filter::Bilinear || std::abs(sum - 1) < kFuzz)
      for (uint32_t i = 0; i < span.count; ++i) weights_[span.weights + i] /= sum;
    spans_.push_back(span);
  }
}

std::span<const double> Cover::weights(int column) const {
  const Span& span = spans_[size_t(column - begin_)];
  return {weights_.data() + span.weights, span.count};
}

}  // namespace fathom::deep
