#include "deep/depth_range.h"

#include <algorithm>
#include <cmath>

namespace fathom::deep {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// The integral over [a, b] of what is 1 before `plane` and falls to 0 over the length `ramp` behind it.
double shadeBefore(double plane, double ramp, double a, double b) {
  const double before = std::max(0.0, std::min(b, plane) - a);
  const double begin = std::max(a, plane), end = std::min(b, plane + ramp);
  return begin < end ? before + (end - begin) * (1 - ((begin - plane) + (end - plane)) / (2 * ramp)) : before;
}

}  // namespace

RangeCut::RangeCut(const DepthRange& range)
    : near_(range.near),
      far_(range.far),
      ramp_(range.soft > 0 ? std::min(double(range.soft), (double(far_) - double(near_)) / 2) : 0),
      fullNear_(near_ + ramp_),
      fullFar_(far_ - ramp_),
      empty_(!(near_ < far_)),
      open_(std::isinf(far_)),
      inverted_(range.inverted) {
  lastBefore_ = open_ ? kInfinity : std::nextafter(far_, -kInfinity);
  firstInside_ = std::nextafter(float(fullNear_), near_ < fullNear_ ? kInfinity : near_);
  lastInside_ = open_ ? kInfinity : std::nextafter(float(fullFar_), -kInfinity);
  if (empty_) {
    near_ = firstInside_ = kInfinity;
    far_ = lastBefore_ = lastInside_ = -kInfinity;
  }
}

// Whether nothing of it fades.
bool RangeCut::isInside(const Range& sample) const {
  return !empty_ && sample.z >= fullNear_ && sample.zBack <= fullFar_ && (sample.z < fullFar_ || open_);
}

bool RangeCut::isOutside(const Range& sample) const {
  return empty_ || sample.zBack < near_ || (sample.zBack == near_ && !sample.isPoint()) || (sample.z >= far_ && !open_);
}

double RangeCut::fadeAt(double z) const {
  const auto rise = [&](double behind) { return ramp_ > 0 ? std::clamp(behind / ramp_, 0.0, 1.0) : 1.0; };
  if (empty_ || z < near_ || (z >= far_ && !open_)) return 0;
  return std::min(std::isinf(near_) ? 1 : rise(z - near_), open_ ? 1 : rise(far_ - z));
}

// The integral of 1 minus the fade.
double RangeCut::removedBetween(double a, double b) const {
  return shadeBefore(near_, ramp_, a, b) + shadeBefore(-far_, ramp_, -b, -a);
}

// What is left of a volume between two depths, where the fade is above 0.
Fragment RangeCut::part(const Range& whole, double alpha, double begin, double end) const {
  const double removed = removedBetween(begin, end), left = inverted_ ? removed : (end - begin) - removed;
  const Range range{float(begin), float(end)};
  if (alpha == 1) return {range, left / (end - begin), left / (end - begin)};
  const Part part = partOf(alpha, left / (double(whole.zBack) - double(whole.z)));
  return {range, part.alpha, part.weight};
}

bool RangeCut::leavesAnything(const Range& sample) const {
  if (leavesWhole(sample)) return true;
  if (leavesNothing(sample)) return false;
  std::array<Fragment, 2> parts;
  return !cut(sample, 0, parts).empty();
}

std::span<const Fragment> RangeCut::cut(const Range& sample, double alpha, std::array<Fragment, 2>& parts) const {
  size_t count = 0;
  const auto add = [&](double begin, double end) {
    if (begin < end) parts[count++] = part(sample, alpha, begin, end);
  };
  const double begin = sample.z, end = sample.zBack;
  if (inverted_ ? isInside(sample) : isOutside(sample)) return {};
  if (inverted_ ? isOutside(sample) : isInside(sample)) {
    parts[count++] = {sample, alpha, 1};
  } else if (sample.isPoint()) {
    const double fade = inverted_ ? 1 - fadeAt(begin) : fadeAt(begin);
    if (fade > 0) parts[count++] = {sample, alpha * fade, fade};
  } else if (inverted_) {
    add(begin, std::min(end, fullNear_));
    add(std::max(begin, fullFar_), end);
  } else {
    add(std::max(begin, double(near_)), std::min(end, double(far_)));
  }
  return {parts.data(), count};
}

}  // namespace fathom::deep
