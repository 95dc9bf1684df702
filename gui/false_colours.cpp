#include "gui/false_colours.h"

#include <algorithm>
#include <cmath>

#include "flat/colour_scale.h"
#include "flat/heatmap.h"

namespace fathom::gui {

namespace {

constexpr float kTold = 0.01f;  // differences above this are told apart by their logarithm

template <class Colour>
Scale makeScale(const Colour& colour) {
  Scale scale(1024);
  for (size_t i = 0; i < scale.size(); ++i) scale[i] = fromDisplay(colour(float(i) / float(scale.size() - 1)));
  return scale;
}

QString number(double value) {
  return QString::number(value, 'g', 3);
}

}  // namespace

QRgb fromDisplay(const std::array<float, 3>& colour) {
  const auto byte = [](float v) { return int(std::lround(255 * std::clamp(v, 0.0f, 1.0f))); };
  return qRgb(byte(colour[0]), byte(colour[1]), byte(colour[2]));
}

bool hasFalseColours(Layer::Kind kind) {
  using Kind = Layer::Kind;
  return kind != Kind::Colour && kind != Kind::Vector && kind != Kind::Identifier;
}

ValueRange endsOf(const ViewState& state, const ValueRange& ofPicture) {
  const DisplayParams& params = state.display;
  return params.low != params.high ? ValueRange{params.low, params.high} : ofPicture;
}

Scale numberScale(Layer::Kind kind) {
  return makeScale([&](float t) { return flat::evenColour(kind == Layer::Kind::Depth ? 1 - t : t); });
}

Scale differenceScale() {
  return makeScale([](float t) { return flat::signedColour(2 * t - 1); });
}

Scale errorScale() {
  return makeScale(flat::heatColour);
}

float differencePlace(float difference) {
  return 0.5f + 0.5f * std::asinh(difference / kTold) / std::asinh(1 / kTold);
}

float errorPlace(float error) {
  return std::log(error / flat::kHeatmapLow) / std::log(flat::kHeatmapHigh / flat::kHeatmapLow);
}

FalseColours falseColours(const Layer& layer, const ViewState& state, Comparison comparison, const ValueRange& ends) {
  using Kind = Layer::Kind;
  FalseColours result;
  const float gain = std::exp2(state.display.exposure);
  if (comparison == Comparison::Difference) {
    result.scale = differenceScale();
    for (const float d : {-1.0f, -0.1f, 0.0f, 0.1f, 1.0f})
      result.ticks.emplace_back(differencePlace(d), number(double(d / gain)));
  } else if (comparison == Comparison::RelativeError) {
    result.scale = errorScale();
    for (const float e : {0.01f, 0.03f, 0.1f, 0.3f, 1.0f})
      result.ticks.emplace_back(errorPlace(e), number(100 * double(e / gain)) + " %");
  } else if (hasFalseColours(layer.kind)) {
    result.scale = numberScale(layer.kind);
    const ValueRange shown = endsOf(state, ends);
    const bool grows = layer.kind == Kind::Scalar || layer.kind == Kind::Variance;
    for (const double place : {0.0, 0.5, 1.0}) {
      const double value = shown.low + place * (double(shown.high) - double(shown.low));
      result.ticks.emplace_back(place, number(grows ? value / double(gain) : value));
    }
  }
  return result;
}

}  // namespace fathom::gui
