// A deep image as a cloud of points, in the form of a binary PLY file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::deep {

struct PointsParams {
  bool world = true;                      // world space, else that of the camera: x right, y up, z the depth
  std::optional<float> fieldOfView = {};  // horizontal, in degrees; else what ViewRays finds in the attributes
  float leastAlpha = 0.01f;               // samples with less are left out
  int every = 1;                          // of so many samples about one is taken, at places that do not line up
};

// Whether world space is known: there is a worldToCamera with an inverse.
bool hasWorldSpace(const DeepImage& image);

// The points of an image or of a band, in the order of its samples, as a PLY file has them: x, y, z as float, then red,
// green, blue and alpha as bytes. A point stands in the middle of its pixel at its Z, that of a volume in the middle of
// the volume; colours are divided by alpha (light without alpha is as it is) and have the sRGB curve; a missing channel
// of R, G, B counts as white. Samples at depths that are not finite are left out; samples may lie in any order. Which
// samples are taken does not depend on the band. Halo 0. Throws Error where A or Z is missing, where the field of view is
// not known or is none, and where world space is asked for and not known.
std::vector<uint8_t> plyPoints(const DeepImage& image, const PointsParams& params);
inline constexpr size_t kPlyPointBytes = 16;

// What stands before the points in the file; as long for any number of points.
std::string plyHeader(uint64_t points);

}  // namespace fathom::deep
