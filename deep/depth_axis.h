// Depths along a line, evenly or by their logarithm.
#pragma once

#include <cmath>
#include <vector>

namespace fathom::deep {

struct DepthAxis {
  double near = 0, far = 1;  // finite, near < far; logarithmic: near > 0
  bool logarithmic = false;

  // 0 at `near`, 1 at `far`, and beyond that for depths beyond them; infinite for infinite depths.
  double place(double depth) const {
    if (!logarithmic) return (depth - near) / (far - near);
    return depth > 0 ? std::log(depth / near) / std::log(far / near) : -HUGE_VAL;
  }
  double depth(double place) const {
    return logarithmic ? near * std::pow(far / near, place) : near + place * (far - near);
  }
  bool operator==(const DepthAxis&) const = default;
};

// The cells + 1 planes between cells of equal length on the axis; the first is `near`, and a point at `far` is in front
// of the last. They do not fall.
std::vector<float> cellPlanes(const DepthAxis& axis, int cells);

// An axis that holds the depths from `nearest` to `farthest` with a little room on both sides; logarithmic only where
// all depths are positive. Where there are none (nearest > farthest), from 0 to 1.
DepthAxis axisAround(double nearest, double farthest, bool logarithmic);

// The axis `factor` times as long, with the depth at `place` where it is; within `whole`, which is as logarithmic, and not
// so short that its depths are the same FLOAT.
DepthAxis zoomed(const DepthAxis& axis, const DepthAxis& whole, double place, double factor);

// At most `most` round depths on the axis, in order: multiples of 1, 2 or 5 times a power of ten. For a logarithmic axis
// that spans more than a factor of ten, 1, 2 and 5 times powers of ten, or powers alone.
std::vector<double> ticks(const DepthAxis& axis, int most);

}  // namespace fathom::deep
