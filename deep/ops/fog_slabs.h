// What of a fog lies along one ray: slabs of even extinction.
#pragma once

#include <span>
#include <vector>

#include "deep/ops/fog.h"
#include "deep/view_rays.h"
#include "deep/volume.h"

namespace fathom::deep {

// Slabs follow each other from near to far. Between borders[i] and borders[i + 1] the optical depth in front grows
// evenly from depths[i] to depths[i + 1]; depths[0] is 0. Without fog both are empty.
class FogSlabs {
 public:
  // Throws Error as `fogVolumes` does. `params` must outlive this.
  FogSlabs(const DeepImage& image, const FogParams& params);

  void set(int x, int y);
  std::span<const float> borders() const { return borders_; }
  std::span<const double> depths() const { return depths_; }

  // Of the light of a point at z, what passes the fog in front of it.
  double passing(float z) const;
  // Of the light of a volume of that optical depth as it is seen without the fog, what passes.
  double passing(const Range& range, double own) const;

 private:
  // A stretch of the ray on which density falls evenly, or rises, by a factor e every 1 / |rate|.
  struct Stretch {
    double from, to, densest, rate;  // rate > 0: densest at `from`, < 0: at `to`

    double depthWithin(double length) const;  // of `length` from its densest end
    double lengthWithin(double depth) const;  // the other way round
    double depth() const { return depthWithin(to - from); }
    double where(double depth) const;    // the place with so much of it in front
    double depthBefore(double z) const;  // the other way round
  };
  void findStretches(const ViewRay& ray);
  double depthTo(double z) const;

  const FogParams& params_;
  ViewRays rays_;
  std::vector<Stretch> stretches_;
  std::vector<double> wanted_;  // optical depths in front of the borders that there shall be
  std::vector<float> borders_;
  std::vector<double> depths_;
};

}  // namespace fathom::deep
