// What estimated errors come to over a frame and its tiles: the figure that a target is compared with.
#pragma once

#include <vector>

#include "flat/noise.h"

namespace fathom::flat {

inline constexpr int kErrorTile = 64;

struct TileError {
  Box window;         // within the data window, cut from its corner
  double relMse = 0;  // of the result
};

// Means over R, G, B and pixels of error / (z^2 + 0.01), where z is the result in the place of the unknown truth: what
// flat/metrics calls relMSE, estimated.
struct ErrorSummary {
  double relMse = 0;             // of the result
  double render = 0;             // of the render: its variances in place of the errors
  std::vector<TileError> tiles;  // of kErrorTile x kErrorTile pixels, row by row
};

// `result`: with R, G, B and error.R, error.G, error.B; `noise`: of the render that it was made from. Values that are
// not finite are passed over.
ErrorSummary summarizeErrors(const Image& result, const Noise& noise);

}  // namespace fathom::flat
