#include "deep/ops/pixel_curve.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fathom::deep {

namespace {

// The optical depth of a volume whose alpha is less than 1 as FLOAT, too: with 1, it would hide all from its front on.
constexpr double kThickest = 17;

constexpr size_t kCurves = std::tuple_size_v<CurvePoint>;

double distance(const CurvePoint& a, const CurvePoint& b) {
  double most = 0;
  for (size_t c = 0; c < kCurves; ++c) most = std::max(most, std::abs(a[c] - b[c]));
  return most;
}

CurvePoint between(const CurvePoint& a, const CurvePoint& b, double fraction) {
  CurvePoint result;
  for (size_t c = 0; c < kCurves; ++c) result[c] = a[c] + (b[c] - a[c]) * fraction;
  return result;
}

// How all curves go through a volume of an optical depth: from 0 at its front to 1 at its back, and how steep at its
// front.
double inside(double depth, double x) {
  return depth > 0 ? std::expm1(-depth * x) / std::expm1(-depth) : x;
}
double steepness(double depth) {
  return depth > 0 ? -depth / std::expm1(-depth) : 1;
}

// Steps jump where they are points, and where they are opaque at their front.
bool jumps(const CurveStep& step) {
  return step.range.isPoint() || std::isinf(step.depth);
}

// A point inside of a volume, where no other is.
Range middleOf(const Range& range) {
  const auto z = float(range.middle());
  return {z, z};
}

// The largest `end` that is found to fit, at least `good`, which is known to.
template <class Fits>
size_t largestEnd(size_t good, size_t count, const Fits& fits) {
  size_t bad = count + 1;
  for (size_t step = 1; good < count; step *= 2) {
    const size_t next = std::min(good + step, count);
    if (!fits(next)) {
      bad = next;
      break;
    }
    good = next;
  }
  while (good + 1 < bad && good < count) {
    const size_t middle = good + (bad - good) / 2;
    (fits(middle) ? good : bad) = middle;
  }
  return good;
}

// Points in place of steps from `begin` on. All of the curves in front of the point must be near their beginning, all
// behind it near their end.
class PointFit {
 public:
  PointFit(const PixelCurve& curve, size_t begin) : curve_(curve), begin_(begin), frontEnd_(begin) {
    while (frontEnd_ < curve.steps.size() && near(frontEnd_ + 1, begin)) ++frontEnd_;
  }

  // Steps up to here fit for certain.
  size_t sure() const { return std::max(frontEnd_, begin_ + 1); }
  bool fits(size_t end) const { return place(end) < end; }
  // The step in whose place the point is, of those that do the one that changes most; `end` where there is none.
  size_t place(size_t end) const {
    size_t backBegin = end;
    while (backBegin > begin_ && near(backBegin - 1, end)) --backBegin;
    size_t best = end;
    double most = -1;
    for (size_t p = backBegin > begin_ ? backBegin - 1 : begin_; p <= frontEnd_ && p < end; ++p) {
      const double change = distance(curve_.points[p], curve_.points[p + 1]);
      if (change > most && canStandFor(p, end)) most = change, best = p;
    }
    return best;
  }

 private:
  bool near(size_t a, size_t b) const { return distance(curve_.points[a], curve_.points[b]) <= 1; }
  bool canStandFor(size_t p, size_t end) const {
    if (jumps(curve_.steps[p])) return true;
    const Range& range = curve_.steps[p].range;
    if (!(middleOf(range).z > range.z && middleOf(range).z < range.zBack)) return false;
    const CurvePoint middle = between(curve_.points[p], curve_.points[p + 1], inside(curve_.steps[p].depth, 0.5));
    return distance(middle, curve_.points[begin_]) <= 1 && distance(middle, curve_.points[end]) <= 1;
  }

  const PixelCurve& curve_;
  size_t begin_, frontEnd_;
};

// A volume in place of the steps [begin, end).
class VolumeFit {
 public:
  VolumeFit(const PixelCurve& curve, size_t begin, size_t end)
      : curve_(curve), begin_(begin), end_(end), range_{curve.steps[begin].range.z, curve.steps[end - 1].range.zBack} {
    for (size_t k = begin; k < end; ++k) depth_ += curve.steps[k].depth;
  }

  Range range() const { return range_; }
  bool fits() const {
    if (!std::isfinite(range_.z) || !std::isfinite(range_.zBack) || range_.isPoint()) return false;
    if (depth_ > kThickest) return false;
    for (size_t k = begin_; k < end_; ++k)
      if (!stepFits(k)) return false;
    return true;
  }

 private:
  double at(float z) const { return (double(z) - double(range_.z)) / (double(range_.zBack) - double(range_.z)); }
  CurvePoint valueAt(double x) const { return between(curve_.points[begin_], curve_.points[end_], inside(depth_, x)); }

  bool stepFits(size_t k) const {
    const CurveStep& step = curve_.steps[k];
    const double front = at(step.range.z);
    const CurvePoint value = valueAt(front);
    const double before = distance(value, curve_.points[k]);
    if (!(before <= 1)) return false;
    if (step.range.isPoint()) return distance(value, curve_.points[k + 1]) <= 1;
    const double back = at(step.range.zBack), behind = distance(valueAt(back), curve_.points[k + 1]);
    return behind <= 1 && staysNear(k, front, back, 1 - std::max(before, behind));
  }

  // Whether inside of the k-th step, a volume from x = front to back, the distance stays within 1; at its ends there is
  // `slack` left. The difference of two exponentials has at most one extremum.
  bool staysNear(size_t k, double front, double back, double slack) const {
    const double own = curve_.steps[k].depth, other = depth_ * (back - front);
    const double ownSteep = steepness(own), steep = steepness(depth_) * std::exp(-depth_ * front) * (back - front);
    for (size_t c = 0; c < kCurves; ++c) {
      const double ownSlope = (curve_.points[k + 1][c] - curve_.points[k][c]) * ownSteep;
      const double slope = (curve_.points[end_][c] - curve_.points[begin_][c]) * steep;
      // Bound without a logarithm, which most steps need no more than.
      const bool flat = (std::abs(ownSlope) * own + std::abs(slope) * other) / 8 <= slack;
      if (flat || !(ownSlope * slope > 0) || own == other) continue;
      const double y = std::log(ownSlope / slope) / (own - other);
      if (!(y > 0 && y < 1)) continue;
      const CurvePoint value = between(curve_.points[k], curve_.points[k + 1], inside(own, y));
      if (!(std::abs(value[c] - valueAt(front + y * (back - front))[c]) <= 1)) return false;
    }
    return true;
  }

  const PixelCurve& curve_;
  size_t begin_, end_;
  Range range_;
  double depth_ = 0;
};

}  // namespace

Fit longestFit(const PixelCurve& curve, size_t begin, bool volumes) {
  const size_t count = curve.steps.size();
  const PointFit point(curve, begin);
  const size_t pointEnd = largestEnd(point.sure(), count, [&](size_t end) { return point.fits(end); });
  if (volumes) {
    const auto fits = [&](size_t end) { return VolumeFit(curve, begin, end).fits(); };
    const size_t end = largestEnd(begin + 1, count, fits);
    const bool forVolumes =
        std::any_of(curve.steps.begin() + std::ptrdiff_t(begin), curve.steps.begin() + std::ptrdiff_t(end),
                    [](const CurveStep& step) { return !step.range.isPoint(); });
    if (end > begin + 1 && (end > pointEnd || (end == pointEnd && forVolumes)))
      return {end, VolumeFit(curve, begin, end).range()};
  }
  if (pointEnd == begin + 1) return {pointEnd, curve.steps[begin].range};
  const CurveStep& step = curve.steps[point.place(pointEnd)];
  return {pointEnd, jumps(step) ? step.range : middleOf(step.range)};
}

}  // namespace fathom::deep
