// A deep image on another grid of pixels: moved, shrunk, enlarged.
#pragma once

#include "deep/image.h"
#include "deep/ops/axis_map.h"

namespace fathom::deep {

struct Resampling {
  AxisMap columns = {}, rows = {};
  Filter filter = Filter::Box;
  double tolerance = 0.01;  // relative; depths that close become one sample, where pixels are mixed (see AreaMean)

  // Whether pixels are mixed, or only copied.
  bool mixes() const {
    if (columns.isWholeMove() && rows.isWholeMove()) return false;
    return filter != Filter::Box || !columns.copies() || !rows.copies();
  }
};

// Each pixel of the result is the weighted mean of the pixels that it covers, as one deep pixel: flattening it gives
// what resampling the flattened image gives, within 2^-21 of the largest sum of the magnitudes of a pixel's samples.
// Pixels outside of the data window are empty.
//
// Where pixels are only copied, samples pass bit for bit, all channels with them. Otherwise the image is made tidy
// first, statistics and half buffers are dropped, and so are the attributes fathom:spp and deepImageState; a new sample
// has the id of the one that is most seen, and what lies behind an opaque sample goes, since no part of the new pixel
// shows it. The display window stays. Throws Error where A or Z is missing, and where volumes overlap too much (see
// tidy). Halo: see neededBy.
DeepImage resample(DeepImage image, const Resampling& how);

Box resampledWindow(const Box& dataWindow, const Resampling& how);

}  // namespace fathom::deep
