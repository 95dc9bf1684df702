// A plane of relative errors as a picture: black over purple, red and orange to light yellow, brighter the larger.
#pragma once

#include <array>

#include "flat/image.h"

namespace fathom::flat {

// The scale is logarithmic and the same for every picture: 1 % and below is black, 100 % and above the brightest.
inline constexpr float kHeatmapLow = 0.01f, kHeatmapHigh = 1.0f;

// The colour at t in [0,1], sRGB display values; lightness rises steadily with t.
std::array<float, 3> heatColour(float t);

// R, G, B in display values, for writePng: the errors of the data window `window`, row by row, and below them the
// labelled scale. NaN becomes cyan, which the scale does not have.
Image heatmap(const Plane& errors, const Box& window);

}  // namespace fathom::flat
