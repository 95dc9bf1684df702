// Analytic fog between two depths, even or thinning out with height.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "deep/image.h"
#include "deep/view_rays.h"

namespace fathom::deep {

// Fog that thins out: full density up to `height`, in world units, and above it less by a factor e every `falloff`.
struct FogHeight {
  double height = 0, falloff = 1;
  Axis up = Axis::Y;
  int slabs = 16;  // volumes per pixel that stand for it, of the same alpha each; more where it is thick
};

struct FogParams {
  double near = 0, far = 100;                     // depths, finite
  double density = 0.01;                          // extinction per unit of length along the ray
  std::array<float, 3> colour = {0.5, 0.5, 0.5};  // of the fog where nothing is seen through it; R, G, B
  std::optional<FogHeight> height = {};
  std::optional<float> fieldOfView = {};  // horizontal, degrees; else the image's attributes have it
};

// The fog in front of every pixel of the data window as an image of volumes: channels R, G, B, A, Z, ZBack. One volume
// where the density does not change along the ray, if its optical depth is at most 4: thicker fog is cut there, and at each
// 4 more up to 20, since a FLOAT alpha cannot tell it. Lengths are measured along the rays; where nothing tells the field
// of view (see ViewRays), along the view axis. At the borders of the volumes the transmittance is exact, and within
// them it is off by less than 1 - exp(-optical depth / slabs), most often by far less.
//
// Throws Error where near or far is not finite, near is not before far, density is negative or not finite, falloff or
// slabs not above 0, the field of view not between 0 and 180, or when there is a height and attributes that tell the
// field of view or the camera's place are missing, by name. Halo 0.
DeepImage fogVolumes(const DeepImage& image, const FogParams& params);

// Inserts it: the merge of the image and its fog. Halo 0.
DeepImage insertFog(DeepImage image, const FogParams& params);

// Applies it to the samples: each keeps its depths and its alpha, is attenuated by the fog in front of it and gets the
// light of that fog in its place; one more point, at `far` or just behind the last sample, stands for the fog that is
// seen between them all. Flattened, that is the same as the fog inserted; but nothing can be put into that fog any more.
//
// Premultiplied channels are attenuated; the fog's light is added to R, G and B only, as far as the image has them. Samples that overlap are split and
// merged as `tidy` does. Samples that begin before `near` and are points pass bit for bit. Statistics and half buffers
// are left out. Alphas, depths and values of no use count as in `flatten`; a sample at infinity that is not opaque
// shares its place with the fog's point. Throws Error as above, when A or Z is missing, and where volumes overlap too
// much (see `tidy`). Halo 0.
DeepImage applyFog(DeepImage image, const FogParams& params);

}  // namespace fathom::deep
