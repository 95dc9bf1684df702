// What lies between two depths, with hard or soft ends, and what that leaves of a sample.
#pragma once

#include <array>
#include <limits>
#include <span>

#include "deep/volume.h"

namespace fathom::deep {

// Half-open as in deep/clip: [near, far), with an infinite `far` all that is behind `near`; nothing where near >= far.
// None of the depths may be NaN.
struct DepthRange {
  float near = -std::numeric_limits<float>::infinity();
  float far = std::numeric_limits<float>::infinity();
  float soft = 0;         // depth over which things fade in behind `near` and out before `far`; 0: hard planes
  bool inverted = false;  // what the range leaves out

  bool isAll() const {
    return near == -std::numeric_limits<float>::infinity() && far == std::numeric_limits<float>::infinity() &&
           !inverted;
  }
  bool operator==(const DepthRange&) const = default;
};

// A part of a sample: its depths, its alpha, and the factor of premultiplied values.
struct Fragment {
  Range range;
  double alpha, weight;
};

// Cuts samples by a range. The fade rises in a straight line from 0 at `near` to 1 at `near + soft`, and falls likewise
// before `far`; where the two would meet, each takes half of the range. Inverted, it is 1 minus that.
// - A point, or an opaque volume (by the mean fade between the planes), has alpha and premultiplied values multiplied by
//   the fade.
// - Any other volume is a medium whose density is multiplied by it, which with hard planes is the cut of deep/clip. So
//   what is kept and what is removed let pass together, one times the other, what the whole does.
class RangeCut {
 public:
  explicit RangeCut(const DepthRange& range);

  // Quick answers, right for nearly all samples; where neither is true, ask cut().
  bool leavesWhole(const Range& sample) const { return inverted_ ? isFarOutside(sample) : isWellInside(sample); }
  bool leavesNothing(const Range& sample) const { return inverted_ ? isWellInside(sample) : isFarOutside(sample); }

  // Whether cut() leaves something of a sample, whatever its alpha.
  bool leavesAnything(const Range& sample) const;

  // What is left, front to back: nothing, one part, or two, which is only so where inverted. `parts` is where it lies.
  std::span<const Fragment> cut(const Range& sample, double alpha, std::array<Fragment, 2>& parts) const;

 private:
  bool isWellInside(const Range& sample) const { return sample.z >= firstInside_ && sample.zBack <= lastInside_; }
  bool isFarOutside(const Range& sample) const { return sample.zBack < near_ || sample.z > lastBefore_; }
  bool isInside(const Range& sample) const;
  bool isOutside(const Range& sample) const;
  double fadeAt(double z) const;
  double removedBetween(double a, double b) const;
  Fragment part(const Range& whole, double alpha, double begin, double end) const;

  float near_, far_;
  float lastBefore_;                // the last depth before `far`
  float firstInside_, lastInside_;  // depths between which nothing fades
  double ramp_, fullNear_, fullFar_;
  bool empty_, open_, inverted_;
};

}  // namespace fathom::deep
