// Moving an image: in the plane by whole and part pixels, in depth by an offset and a scale.
#pragma once

#include "deep/ops/resample.h"

namespace fathom::deep {

struct Transform {
  double x = 0, y = 0;  // pixels to the right and down
  double scale = 1;     // in the plane, about the middle of the display window, before it is moved
  double z = 0;         // Z becomes Z * zScale + z
  double zScale = 1;
  double tolerance = 0.001;  // see Resampling; depths as they are afterwards

  // How the pixels of an image move; empty of effect where they do not.
  Resampling resampling(const Box& displayWindow) const;
  bool movesWholePixels() const;
  // Throws Error where a number is not finite, a scale is not positive or beyond 1000, or the tolerance is negative.
  void check() const;
};

// Whole moves shift the data window and pass the samples bit for bit; all others resample (see there what becomes of
// samples, channels and attributes). The display window stays.
//
// Z and ZBack move together: points stay points, and a range keeps a length of at least one step of a float. variance.Z
// is scaled, too. Depths that are not finite stay what they are. Throws Error as `check` does; where Z is missing and
// depths move; as `resample` does where it is needed. Halo: see neededBy with the resampling's rows.
DeepImage transform(DeepImage image, const Transform& how);

// The data window that `transform` makes of another.
Box transformedWindow(const Box& dataWindow, const Box& displayWindow, const Transform& how);

}  // namespace fathom::deep
