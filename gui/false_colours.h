// The scales that numbers are shown on, and what their colours mean.
#pragma once

#include <QRgb>
#include <QString>
#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "gui/seen.h"
#include "gui/view_state.h"

namespace fathom::gui {

// The ends of a scale of false colours.
struct ValueRange {
  float low = 0, high = 1;
};

// Whether layers of that kind are shown on a scale.
bool hasFalseColours(Layer::Kind kind);

// Those of the state, or `ofPicture` where those are equal.
ValueRange endsOf(const ViewState& state, const ValueRange& ofPicture);

// From display values in [0,1].
QRgb fromDisplay(const std::array<float, 3>& colour);

// Colours at even steps of t in [0,1], and the one at t, brought into that.
using Scale = std::vector<QRgb>;
inline QRgb lookUp(const Scale& scale, float t) {
  const float inside = std::min(std::max(0.0f, t), 1.0f);  // NaN is 0
  return scale[size_t(inside * float(scale.size() - 1) + 0.5f)];
}
Scale numberScale(Layer::Kind kind);  // depths run from light to dark, all else from dark to light
Scale differenceScale();              // from -1 over 0 to 1
Scale errorScale();

// Where on their scales a difference and a relative error, times a gain, have their place.
float differencePlace(float difference);
float errorPlace(float error);

// What to tell of the colours on the screen; nothing where they are what they are.
struct FalseColours {
  Scale scale;
  std::vector<std::pair<double, QString>> ticks;  // places in [0,1]
};
FalseColours falseColours(const Layer& layer, const ViewState& state, Comparison comparison, const ValueRange& ends);

}  // namespace fathom::gui
