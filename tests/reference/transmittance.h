// What light passes through a deep pixel, as a function of depth: the product of what each sample lets through, in long
// double, without sorting, cutting or merging anything. For finite depths.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

namespace fathom::reference {

struct PixelSamples {
  std::span<const float> alpha, z, zBack;  // zBack empty: points

  float back(size_t i) const { return zBack.empty() ? z[i] : std::max(z[i], zBack[i]); }
  long double opacity(size_t i) const { return alpha[i] > 0 ? std::min(1.0L, (long double)(alpha[i])) : 0.0L; }
};

// Through everything in front of `depth`, and, with `including`, through the points at that depth.
inline long double transmittance(const PixelSamples& pixel, long double depth, bool including) {
  long double passed = 1;
  for (size_t i = 0; i < pixel.z.size(); ++i) {
    const long double z = pixel.z[i], length = pixel.back(i) - z;
    if (length == 0)
      passed *= z < depth || (including && z == depth) ? 1 - pixel.opacity(i) : 1;
    else if (depth > z)
      passed *= std::pow(1 - pixel.opacity(i), std::min(1.0L, (depth - z) / length));
  }
  return passed;
}

// Where the nearest sample with alpha begins; infinity without any.
inline float firstSeen(const PixelSamples& pixel) {
  float first = std::numeric_limits<float>::infinity();
  for (size_t i = 0; i < pixel.z.size(); ++i)
    if (pixel.opacity(i) > 0) first = std::min(first, pixel.z[i]);
  return first;
}

// Where the last sample ends that is not hidden by an opaque one; -infinity without any alpha.
inline float lastSeen(const PixelSamples& pixel) {
  float wall = std::numeric_limits<float>::infinity(), last = -wall;
  for (size_t i = 0; i < pixel.z.size(); ++i)
    if (pixel.opacity(i) == 1) wall = std::min(wall, pixel.z[i]);
  for (size_t i = 0; i < pixel.z.size(); ++i)
    if (pixel.opacity(i) > 0 && pixel.z[i] <= wall) last = std::max(last, std::min(pixel.back(i), wall));
  return last;
}

}  // namespace fathom::reference
