#include "gui/colouring.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

#include "flat/colour_scale.h"
#include "flat/error.h"
#include "flat/finite.h"
#include "flat/metrics.h"
#include "flat/parallel.h"

namespace fathom::gui {

namespace {

using Kind = Layer::Kind;
using Colour = std::array<float, 3>;

constexpr QRgb kBlack = 0xff000000;

QRgb pack(const Colour& c) {
  const auto byte = [](float v) { return int(std::lround(255 * std::clamp(v, 0.0f, 1.0f))); };
  return qRgb(byte(c[0]), byte(c[1]), byte(c[2]));
}

// row(index of its first pixel, its pixels to be) for every row, in parallel.
template <class Row>
QImage makeRows(const Seen& seen, const Row& row) {
  QImage image(seen.width, seen.height, QImage::Format_RGB32);
  if (image.isNull()) return image;
  uchar* bits = image.bits();
  const qsizetype stride = image.bytesPerLine();
  parallelRanges(0, seen.height, 8, [&](int first, int last) {
    for (int y = first; y < last; ++y) row(size_t(y) * size_t(seen.width), reinterpret_cast<QRgb*>(bits + y * stride));
  });
  return image;
}

template <class AtPixel>
QImage makePixels(const Seen& seen, const AtPixel& at) {
  return makeRows(seen, [&](size_t first, QRgb* to) {
    for (int x = 0; x < seen.width; ++x) to[x] = at(first + size_t(x));
  });
}

bool covers(const Seen& seen, size_t i) {
  return seen.alpha.empty() || seen.alpha[i] != 0;
}

bool isSpoiled(const Seen& seen, size_t i) {
  return !seen.spoiled.empty() && seen.spoiled[i] != 0;
}

// The channels that are looked at: one that is isolated where there are three, or else all.
std::vector<size_t> chosen(const Seen& seen, Isolate isolate) {
  std::vector<size_t> all(seen.values.size());
  std::iota(all.begin(), all.end(), size_t(0));
  const bool one = isolate == Isolate::Red || isolate == Isolate::Green || isolate == Isolate::Blue;
  return one && all.size() == 3 ? std::vector{size_t(isolate) - size_t(Isolate::Red)} : all;
}

// Scene-linear light of pixel i: grey where a channel is isolated.
Colour lightOf(const Seen& seen, Isolate isolate, size_t i) {
  const auto value = [&](size_t c) { return seen.values[std::min(c, seen.values.size() - 1)][i]; };
  const Colour rgb = {value(0), value(1), value(2)};
  if (isolate == Isolate::All) return rgb;
  if (isolate == Isolate::Luminance) {
    const float luminance = 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
    return {luminance, luminance, luminance};
  }
  if (isolate == Isolate::Alpha) {
    const float alpha = seen.alpha.empty() ? 1 : seen.alpha[i];
    return {alpha, alpha, alpha};
  }
  const float one = rgb[size_t(isolate) - size_t(Isolate::Red)];
  return {one, one, one};
}

// Which values are marked.
struct Marks {
  bool clipped, nan;
};

QRgb marked(const Colour& value, float gain, const Marks& marks, QRgb otherwise) {
  const auto [low, high] = std::minmax({value[0], value[1], value[2]});
  const bool finite = std::isfinite(value[0]) && std::isfinite(value[1]) && std::isfinite(value[2]);
  if (!finite) return marks.nan ? kMarkNan : otherwise;
  if (marks.clipped && high * gain > 1) return kMarkAbove;
  if (marks.clipped && low * gain < 0) return kMarkBelow;
  return otherwise;
}

// Light, A and vectors: everything that is three numbers to the screen.
QImage colourLight(const Seen& seen, const ViewState& state, const Display& display) {
  const DisplayParams& params = state.display;
  const bool vector = seen.layer.kind == Kind::Vector && state.isolate != Isolate::Alpha;
  const bool data = vector || state.isolate == Isolate::Alpha;
  const RowTransform transform = data ? display.plainTransform(params.gamma) : display.transform(params);
  const Marks marks{params.markClipped && !vector, params.markNan};
  const float gain = std::exp2(params.exposure);
  return makeRows(seen, [&](size_t first, QRgb* to) {
    thread_local std::vector<float> rgba;
    rgba.resize(4 * size_t(seen.width));
    for (size_t x = 0; x < size_t(seen.width); ++x) {
      const Colour light = lightOf(seen, state.isolate, first + x);
      const float half = !vector ? 0 : seen.alpha.empty() ? 0.5f : 0.5f * seen.alpha[first + x];
      for (size_t c = 0; c < 3; ++c)
        rgba[4 * x + c] =
            std::clamp(finiteOrZero(light[c] * gain) * (vector ? 0.5f : 1.0f) + half, -65504.0f, 65504.0f);
      rgba[4 * x + 3] = 1;
    }
    transform(rgba.data(), seen.width, to);
    if (!marks.clipped && !marks.nan) return;
    for (int x = 0; x < seen.width; ++x) {
      if (isSpoiled(seen, first + size_t(x)) && marks.nan)
        to[x] = kMarkNan;
      else
        to[x] = marked(lightOf(seen, state.isolate, first + size_t(x)), gain, marks, to[x]);
    }
  });
}

// The one number of a pixel that false colours show.
float numberOf(const Seen& seen, size_t i) {
  if (seen.layer.kind != Kind::Variance) return seen.values[0][i];
  float sum = 0;
  for (const Buffer<float>& plane : seen.values) sum += plane[i];
  return std::sqrt(std::max(0.0f, sum / float(seen.values.size())));
}

QImage colourNumbers(const Seen& seen, const ViewState& state, const ValueRange& range) {
  const DisplayParams& params = state.display;
  const Kind kind = seen.layer.kind;
  const Scale colours = numberScale(kind);
  const ValueRange ends = endsOf(state, range);
  const float scale = ends.high != ends.low ? 1 / (ends.high - ends.low) : 0;
  const float gain = kind == Kind::Scalar || kind == Kind::Variance ? std::exp2(params.exposure) : 1;
  return makePixels(seen, [&](size_t i) {
    const float value = numberOf(seen, i);
    const bool wrong = isSpoiled(seen, i) || std::isnan(value) || (std::isinf(value) && kind != Kind::Depth);
    if (wrong && params.markNan) return kMarkNan;
    const bool nothing = !std::isfinite(value) || (kind == Kind::Count ? value == 0 : !covers(seen, i));
    return nothing ? kBlack : lookUp(colours, (value * gain - ends.low) * scale);
  });
}

// Whether the channels that are looked at have the same names; one of the two may lack A.
bool areAlike(const Layer& a, const Layer& b) {
  const auto colours = [](const Layer& layer) {
    return std::span(layer.channels).first(std::min<size_t>(3, layer.channels.size()));
  };
  return a.kind == b.kind && std::ranges::equal(colours(a), colours(b));
}

void checkAlike(const Seen& a, const Seen& b) {
  if (!a.ids.empty() || !b.ids.empty()) fail("layer {}: identifiers have no difference", a.layer.name);
  if (!areAlike(a.layer, b.layer))
    fail("layer {}: expected in both pictures, found {} in the other", a.layer.name, b.layer.name);
}

// The channels as metrics take them, by the names R, G and B.
flat::Image asColour(const Seen& seen, Isolate isolate) {
  const Box window{0, 0, seen.width, seen.height};
  flat::Image image{window, window, {}, {}};
  const std::vector<size_t> channels = chosen(seen, isolate);
  for (size_t c = 0; c < 3; ++c)
    image.planes.push_back({std::string(1, "RGB"[c]), seen.values[channels[std::min(c, channels.size() - 1)]].copy()});
  return image;
}

}  // namespace

ValueRange rangeOf(const Seen& seen) {
  const Kind kind = seen.layer.kind;
  if (seen.values.empty() || kind == Kind::Colour || kind == Kind::Vector) return {};
  std::vector<float> values;
  for (size_t i = 0; i < seen.pixels(); ++i)
    if (const float value = numberOf(seen, i); isFinite(value) && covers(seen, i)) values.push_back(value);
  if (values.empty()) return {};
  const auto at = [&](double share) {
    const auto nth = values.begin() + ptrdiff_t(share * double(values.size() - 1));
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
  };
  if (kind == Kind::Depth) return {at(0.01), at(0.99)};
  const float high = at(kind == Kind::Count ? 1 : 0.99);
  return {std::min(0.0f, at(0.01)), high > 0 ? high : 1};
}

QImage colour(const Seen& seen, const ViewState& state, const ValueRange& range, const Display& display) {
  if (!seen.ids.empty()) return makePixels(seen, [&](size_t i) { return pack(flat::identifierColour(seen.ids[i])); });
  const Kind kind = seen.layer.kind;
  if (kind == Kind::Colour || kind == Kind::Vector || (state.isolate == Isolate::Alpha && !seen.alpha.empty()))
    return colourLight(seen, state, display);
  return colourNumbers(seen, state, range);
}

float signedDifference(const Seen& a, const Seen& b, Isolate isolate, size_t index) {
  if (isolate == Isolate::Alpha) return (a.alpha.empty() ? 1 : a.alpha[index]) - (b.alpha.empty() ? 1 : b.alpha[index]);
  if (isolate == Isolate::Luminance && a.values.size() == 3)
    return lightOf(a, isolate, index)[0] - lightOf(b, isolate, index)[0];
  float largest = 0;
  for (const size_t c : chosen(a, isolate))
    if (const float d = a.values[c][index] - b.values[c][index]; !(std::abs(d) <= std::abs(largest))) largest = d;
  return largest;
}

QImage colourDifference(const Seen& a, const Seen& b, const ViewState& state) {
  checkAlike(a, b);
  const Scale colours = differenceScale();
  const float gain = std::exp2(state.display.exposure);
  return makePixels(a, [&](size_t i) {
    const float value = signedDifference(a, b, state.isolate, i);
    if (!std::isfinite(value)) return state.display.markNan ? kMarkNan : kBlack;
    return lookUp(colours, differencePlace(value * gain));
  });
}

QImage colourRelativeError(const Seen& a, const Seen& b, const ViewState& state) {
  checkAlike(a, b);
  const flat::Plane errors = flat::relativeError(asColour(a, state.isolate), asColour(b, state.isolate));
  const Scale colours = errorScale();
  const float gain = std::exp2(state.display.exposure);
  return makePixels(a, [&](size_t i) {
    const float error = errors.values[i];
    if (std::isnan(error)) return state.display.markNan ? kMarkNan : kBlack;
    return lookUp(colours, errorPlace(error * gain));
  });
}

}  // namespace fathom::gui
