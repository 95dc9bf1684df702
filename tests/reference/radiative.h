// The light that arrives along one pixel, by integrating the equation of transfer
//   dL/dz = T(z) e(z),  dT/dz = -T(z) s(z),  T(0) = 1
// in double precision, with Gauss-Legendre quadrature over optical depth. Shares no code and no formula of splitting or
// merging with deep/: a volume is extinction s = -log(1-A) / length and an emission per length that makes the volume
// alone give its colour; what overlaps adds up.
//
// Limits. Points at one depth are a volume that all of them fill together, in front of the volumes that begin there.
// What is opaque has extinction without bound: of several in one place each shows an equal part of itself, and all else
// there shows nothing.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "deep/image.h"

namespace fathom::reference {

struct Medium {
  double z, zBack;  // zBack <= z: a point
  double alpha, colour;
  size_t image = 0;  // which of several images it comes from
};

// What is seen of each image, and what passes all of them.
struct Radiance {
  std::vector<double> light, alpha;
  double transmittance = 1;

  double totalLight() const { return sum(light); }
  double totalAlpha() const { return sum(alpha); }

 private:
  static double sum(const std::vector<double>& values) {
    double total = 0;
    for (const double value : values) total += value;
    return total;
  }
};

inline double opticalDepth(double alpha) {
  return alpha < 1e-37 ? alpha : -std::log1p(-alpha);
}

// The integral of exp(-depth * s) over s in [0,1].
inline double meanTransmittance(double depth) {
  const double at[] = {0, 0.5384693101056831, 0.9061798459386640};
  const double weight[] = {0.5688888888888889, 0.4786286704993665, 0.2369268850561891};
  const int steps = 1 + int(std::ceil(3 * depth));
  double sum = 0;
  for (int i = 0; i < steps; ++i)
    for (int k = -2; k <= 2; ++k) {
      const double s = (i + 0.5 + 0.5 * (k < 0 ? -at[-k] : at[k])) / steps;
      sum += weight[std::abs(k)] / 2 * std::exp(-depth * s) / steps;
    }
  return sum;
}

// Passes through a stretch that each medium fills evenly with the given part of its length.
inline void pass(const std::vector<std::pair<Medium, double>>& stretch, Radiance& seen) {
  double opaque = 0, depth = 0;
  for (const auto& [medium, part] : stretch) opaque += medium.alpha >= 1;
  if (opaque > 0) {
    for (const auto& [medium, part] : stretch) {
      if (medium.alpha < 1) continue;
      seen.light[medium.image] += seen.transmittance * medium.colour / opaque;
      seen.alpha[medium.image] += seen.transmittance / opaque;
    }
    seen.transmittance = 0;
    return;
  }
  for (const auto& [medium, part] : stretch) depth += part * opticalDepth(medium.alpha);
  const double mean = seen.transmittance * meanTransmittance(depth);
  for (const auto& [medium, part] : stretch) {
    const double own = opticalDepth(medium.alpha), alone = meanTransmittance(own);
    seen.light[medium.image] += mean * part * medium.colour / alone;
    seen.alpha[medium.image] += mean * part * own;
  }
  seen.transmittance *= std::exp(-depth);
}

// What is seen of `media` in front of the depth `until`, which is not included.
inline Radiance integrate(const std::vector<Medium>& media, size_t images = 1,
                          double until = std::numeric_limits<double>::infinity()) {
  Radiance seen{std::vector<double>(images), std::vector<double>(images)};
  std::vector<double> borders;
  for (const Medium& medium : media) borders.insert(borders.end(), {medium.z, std::max(medium.z, medium.zBack)});
  if (std::isfinite(until)) borders.push_back(until);
  std::sort(borders.begin(), borders.end());
  borders.erase(std::unique(borders.begin(), borders.end()), borders.end());
  for (size_t i = 0; i < borders.size() && borders[i] < until; ++i) {
    std::vector<std::pair<Medium, double>> points, volumes;
    for (const Medium& medium : media) {
      if (!(medium.zBack > medium.z)) {
        if (medium.z == borders[i]) points.push_back({medium, 1});
      } else if (medium.z <= borders[i] && medium.zBack > borders[i]) {
        volumes.push_back({medium, (borders[i + 1] - borders[i]) / (medium.zBack - medium.z)});
      }
    }
    if (!points.empty()) pass(points, seen);
    if (!volumes.empty()) pass(volumes, seen);
  }
  return seen;
}

// The samples of one pixel, of images whose values are in range: finite depths, alphas in [0,1].
inline std::vector<Medium> mediaOf(const deep::DeepImage& image, size_t pixel, const char* channel = "R",
                                   size_t number = 0) {
  const auto z = image.get("Z"), zBack = image.tryGet("ZBack"), alpha = image.get("A"), colour = image.get(channel);
  std::vector<Medium> media;
  for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i)
    media.push_back({z[i], zBack.empty() ? z[i] : zBack[i], alpha[i], colour[i], number});
  return media;
}

inline std::vector<Medium> together(std::vector<Medium> a, const std::vector<Medium>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

}  // namespace fathom::reference
