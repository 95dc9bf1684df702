// Flattening: a deep image composited into a flat one.
#pragma once

#include <vector>

#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

// Which depth a flat pixel has; see PixelDepths in deep/row_weights.
enum class FlatDepth { Mean, Front, Back, Transmittance };

struct FlattenParams {
  FlatDepth z = FlatDepth::Mean;
  std::vector<FlatDepth> depths = {};  // further channels: Z.mean, Z.front, Z.back, Z.transmittance
  double transmittance = 0.5;          // how much passes at the depth of that name; at least 0, below 1
};

// Every premultiplied channel composited front to back, sums in double precision; half buffers likewise. Samples may
// lie in any order and overlap: they are sorted, split and merged as `tidy` does; but points at the same depth are
// composited one after the other in an image of camera samples or of bins made of them (attribute fathom:spp, or
// channels of statistics), whose alphas count samples. NaN alphas count as 0, others are brought into [0,1]; non-finite
// values (above 1e15 included) count as 0, and sums end at 1e15. Z becomes, as the parameters say:
// - Mean: the mean over the pixel's samples weighted by effective alpha, a volume standing for its middle;
// - Front: where the first sample with alpha begins;
// - Back: where the last sample that is seen ends (an opaque volume: where it begins, for nothing behind that is seen);
// - Transmittance: the first depth behind which no more than the given part of the light passes, exact inside of
//   volumes; Back where more passes through the whole pixel.
// Samples at an infinite depth have no say in these unless all that is seen lies there; where nothing has alpha, Z is
// the nearest. Other channels that are not premultiplied become their mean weighted by effective alpha. An empty pixel
// is 0 in every channel. Left out: ZBack, UINT channels, and variances and sample counts, which cannot be composited;
// and channels that bear the name of a depth that was asked for. Halo 0. Throws Error when A or Z is missing, where the
// transmittance is out of its range, and where volumes overlap too much (see `tidy`).
flat::Image flatten(const DeepImage& image, const FlattenParams& params = {});

}  // namespace fathom::deep
