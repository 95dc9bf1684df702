// Values to colours, as their kind and the state of the view ask.
#pragma once

#include <QImage>

#include "gui/display.h"
#include "gui/false_colours.h"
#include "gui/seen.h"
#include "gui/view_state.h"

namespace fathom::gui {

// What marks a pixel, whatever is shown: nothing else is as loud.
inline constexpr QRgb kMarkNan = 0xffff00ff, kMarkAbove = 0xffff2020, kMarkBelow = 0xff2040ff;

// Between which nearly all of the values lie that the layer covers: without the hundredth at either end of depths, from
// 0 for what has no negative values. Identifiers and colours have none to speak of: [0, 1].
ValueRange rangeOf(const Seen& seen);

// An opaque image of seen.width x seen.height over black.
// - Colours pass exposure, display transform and gamma; a single channel of them or the luminance as grey; A, and
//   vectors as v/2 + 1/2 where they cover, pass exposure and gamma alone.
// - Depths run from light (near) to dark, other numbers from dark to light, of evenColour between the ends of the state,
//   or of `range` where those are equal. Variances are shown by the root of their mean. Exposure scales those, and
//   scalars.
// - Identifiers have a colour each.
QImage colour(const Seen& seen, const ViewState& state, const ValueRange& range, const Display& display);

// One plane: A - B of the channel that differs most, or of the one that is looked at. The windows and channels must be
// the same.
Seen differenceOf(const Seen& a, const Seen& b, Isolate isolate);
// One plane: flat::relativeError of A against B.
Seen relativeErrorOf(const Seen& a, const Seen& b, Isolate isolate);

// The first by signedColour, grown by exposure, on a scale that tells small ones apart, too (asinh); the second in the
// colours of flat::heatColour, on the scale of its heatmaps.
QImage colourDifference(const Seen& difference, const ViewState& state);
QImage colourRelativeError(const Seen& error, const ViewState& state);

}  // namespace fathom::gui
