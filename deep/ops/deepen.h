// Deepen: a flat image as a deep one.
#pragma once

#include <optional>
#include <string>

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

struct DeepenParams {
  std::optional<float> z = {};     // one depth for all pixels; else they have their own:
  std::string depthChannel = "Z";  // the plane that holds it
  float thickness = 0;             // scene units; above 0 each sample is a volume, which begins at the depth
  // A and the premultiplied planes are amounts per unit of length, A being the extinction: alpha becomes
  // 1 - exp(-A * thickness), and colours keep their ratio to it. Else they are those of the whole sample.
  bool extinction = false;
};

// One sample in every pixel with a depth. Empty are pixels whose alpha is 0 and whose colours (R, G and B, also of a
// layer) are 0, and those whose depth is no number; an infinite depth is kept, and is a point. Alphas out of range and
// values that are not finite are passed on, unless there is `extinction`: then they count as 0. Without a plane A all
// is opaque. Flattening gives the image again.
//
// Channels are the planes, FLOAT; the depth's becomes Z. A plane ZBack is kept where the depth is from Z and there is no
// thickness, else it goes. With `extinction`, statistics and half buffers are left out. Windows stay, and attributes,
// as far as their type is one that flat images carry. Throws Error where the plane of the depth is missing, and for
// `extinction` without thickness. Halo 0.
DeepImage deepen(const flat::Image& image, const DeepenParams& params);

}  // namespace fathom::deep
