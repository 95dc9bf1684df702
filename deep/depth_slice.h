// A row of a deep image seen from above: what lies at each column and depth.
#pragma once

#include <string>
#include <vector>

#include "deep/depth_axis.h"
#include "deep/image.h"
#include "flat/image.h"

namespace fathom::deep {

// One row, column by column of [x0, x1), in `cells` cells of equal length on the axis; row 0 of the result is the
// nearest one, its data window is {x0, 0, x1, cells}. A cell holds what flattening makes of the samples between its two
// planes (see cellPlanes), as if nothing were in front: volumes fill all cells that they reach, and the cells of a column
// composited front to back are the pixel, as far as it lies on the axis. Planes: `channels`, of the premultiplied ones,
// and A. Columns outside of the data window are 0, as is all where `y` is outside. Depths that are not finite are left
// out. Throws Error where A, Z or a channel is missing, and where volumes overlap too much (see `tidy`).
flat::Image depthSlice(const DeepImage& image, int y, int x0, int x1, const DepthAxis& axis, int cells,
                       const std::vector<std::string>& channels);

// Where the samples of a row begin and end, infinite depths left out; nearest > farthest where there are none, or no
// such row. Throws Error where Z is missing.
struct DepthExtent {
  float nearest, farthest;
};
DepthExtent depthExtent(const DeepImage& image, int y);

}  // namespace fathom::deep
