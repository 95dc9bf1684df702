#include "gui/colouring.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "flat/colour_scale.h"
#include "flat/finite.h"
#include "flat/metrics.h"

namespace fathom::gui {

namespace {

using Kind = Layer::Kind;

constexpr QRgb kBlack = 0xff000000;

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

// What three channels of light `count` pixels have from `first` on: one three times where it is isolated, or where the
// layer has no more. `made` takes the numbers of what is no channel.
using Light = std::array<const float*, 3>;
Light lightOf(const Seen& seen, Isolate isolate, size_t first, size_t count, std::vector<float>& made) {
  const auto channel = [&](size_t c) { return seen.values[std::min(c, seen.values.size() - 1)].data() + first; };
  const Light all = {channel(0), channel(1), channel(2)};
  const auto three = [](const float* one) { return Light{one, one, one}; };
  if (isolate == Isolate::All) return all;
  if (isolate == Isolate::Alpha && !seen.alpha.empty()) return three(seen.alpha.data() + first);
  if (isolate != Isolate::Alpha && isolate != Isolate::Luminance)
    return three(all[size_t(isolate) - size_t(Isolate::Red)]);
  made.assign(count, 1.0f);
  if (isolate == Isolate::Luminance)
    for (size_t i = 0; i < count; ++i) made[i] = 0.2126f * all[0][i] + 0.7152f * all[1][i] + 0.0722f * all[2][i];
  return three(made.data());
}

// Numbers in HALF's range, into `made`: value * gain + half the alpha of `base`, which may be null. Once where the three
// are the same.
Light scaled(const Light& light, size_t count, float gain, const float* base, std::vector<float>& made) {
  constexpr float kMost = 65504;
  const size_t planes = light[0] == light[1] && light[1] == light[2] ? 1 : 3;
  made.resize(planes * count);
  for (size_t c = 0; c < planes; ++c) {
    const float* from = light[c];
    float* to = made.data() + c * count;
    if (base)
      for (size_t x = 0; x < count; ++x)
        to[x] = std::clamp(finiteOrZero(from[x]) * gain + 0.5f * base[x], -kMost, kMost);
    else
      for (size_t x = 0; x < count; ++x) to[x] = std::clamp(finiteOrZero(from[x]) * gain, -kMost, kMost);
  }
  return {made.data(), made.data() + (planes > 1 ? count : 0), made.data() + (planes > 1 ? 2 * count : 0)};
}

// What is no number, and what leaves [0,1] once it is multiplied by `gain`.
void mark(const Light& light, size_t count, float gain, const DisplayParams& params, QRgb* to) {
  bool finite = true;  // the usual row, told in one pass that compilers vectorise
  for (const float* values : light)
    for (size_t x = 0; x < count; ++x) finite &= std::abs(values[x]) <= std::numeric_limits<float>::max();
  if (finite && !params.markClipped) return;
  for (size_t x = 0; x < count; ++x) {
    const float r = light[0][x], g = light[1][x], b = light[2][x];
    if (!(std::isfinite(r) && std::isfinite(g) && std::isfinite(b))) {
      if (params.markNan) to[x] = kMarkNan;
    } else if (params.markClipped) {
      if (std::min({r, g, b}) * gain < 0) to[x] = kMarkBelow;
      if (std::max({r, g, b}) * gain > 1) to[x] = kMarkAbove;
    }
  }
}

// Light, A and vectors: everything that is three numbers to the screen.
QImage colourLight(const Seen& seen, const ViewState& state, const Display& display) {
  DisplayParams params = state.display;
  const bool vector = seen.layer.kind == Kind::Vector && state.isolate != Isolate::Alpha;
  const bool data = vector || state.isolate == Isolate::Alpha;
  const RowTransform transform = data ? display.plainTransform(params.gamma) : display.transform(params);
  if (vector) params.markClipped = false;
  const float gain = std::exp2(params.exposure);
  const size_t width = size_t(seen.width);
  const std::vector<float> covered(width, 1.0f);
  return makeRows(seen, [&](size_t first, QRgb* to) {
    thread_local std::vector<float> made, ready;
    const Light light = lightOf(seen, state.isolate, first, width, made);
    const float* alpha = seen.alpha.empty() ? covered.data() : seen.alpha.data() + first;
    transform(scaled(light, width, vector ? gain / 2 : gain, vector ? alpha : nullptr, ready), seen.width, to);
    if (params.markClipped || params.markNan) mark(light, width, gain, params, to);
    if (!seen.spoiled.empty() && params.markNan)
      for (size_t x = 0; x < width; ++x)
        if (seen.spoiled[first + x] != 0) to[x] = kMarkNan;
  });
}

QImage colourIdentifiers(const Seen& seen) {
  return makeRows(seen, [&](size_t first, QRgb* to) {
    uint32_t last = 0;
    QRgb colour = kBlack;
    for (size_t x = 0; x < size_t(seen.width); ++x) {
      const uint32_t id = seen.ids[first + x];
      if (id != last) colour = fromDisplay(flat::identifierColour(id));
      to[x] = colour;
      last = id;
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

// What is looked at as metrics take it, by the names R, G and B.
flat::Image asColour(const Seen& seen, Isolate isolate) {
  const Box window{0, 0, seen.width, seen.height};
  flat::Image image{window, window, {}, {}};
  std::vector<float> made;
  const Light light = lightOf(seen, isolate, 0, seen.pixels(), made);
  for (size_t c = 0; c < 3; ++c)
    std::copy_n(light[c], seen.pixels(), image.add(std::string(1, "RGB"[c])).values.data());
  return image;
}

// The difference of the channel that differs most; NaN where one does.
float largestDifference(const Light& a, const Light& b, size_t x) {
  float largest = a[0][x] - b[0][x];
  for (size_t c = 1; c < 3; ++c)
    if (const float d = a[c][x] - b[c][x]; !(std::abs(d) <= std::abs(largest))) largest = d;
  return largest;
}

Seen onePlane(const Seen& like, const std::string& name, Buffer<float> values) {
  Seen seen{{name, {name}, Kind::Scalar}, like.box, like.step, like.width, like.height};
  seen.values.push_back(std::move(values));
  return seen;
}

}  // namespace

ValueRange rangeOf(const Seen& seen) {
  const Kind kind = seen.layer.kind;
  if (!hasFalseColours(kind)) return {};
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
  if (!seen.ids.empty()) return colourIdentifiers(seen);
  if (!hasFalseColours(seen.layer.kind) || (state.isolate == Isolate::Alpha && !seen.alpha.empty()))
    return colourLight(seen, state, display);
  return colourNumbers(seen, state, range);
}

Seen differenceOf(const Seen& a, const Seen& b, Isolate isolate) {
  checkAlike(a, b);
  Seen difference = onePlane(a, "difference", Buffer<float>(a.pixels()));
  parallelRanges(0, a.height, 8, [&](int begin, int end) {
    const size_t width = size_t(a.width), first = size_t(begin) * width, count = size_t(end - begin) * width;
    thread_local std::vector<float> madeA, madeB;
    const Light lightA = lightOf(a, isolate, first, count, madeA), lightB = lightOf(b, isolate, first, count, madeB);
    for (size_t i = 0; i < count; ++i) difference.values[0][first + i] = largestDifference(lightA, lightB, i);
  });
  return difference;
}

Seen relativeErrorOf(const Seen& a, const Seen& b, Isolate isolate) {
  checkAlike(a, b);
  return onePlane(a, "relative error", flat::relativeError(asColour(a, isolate), asColour(b, isolate)).values);
}

QImage colourDifference(const Seen& difference, const ViewState& state) {
  const Scale colours = differenceScale();
  const float gain = std::exp2(state.display.exposure);
  return makePixels(difference, [&](size_t i) {
    const float value = difference.values[0][i];
    if (!std::isfinite(value)) return state.display.markNan ? kMarkNan : kBlack;
    return lookUp(colours, differencePlace(value * gain));
  });
}

QImage colourRelativeError(const Seen& error, const ViewState& state) {
  const Scale colours = errorScale();
  const float gain = std::exp2(state.display.exposure);
  return makePixels(error, [&](size_t i) {
    const float value = error.values[0][i];
    if (std::isnan(value)) return state.display.markNan ? kMarkNan : kBlack;
    return lookUp(colours, errorPlace(value * gain));
  });
}

}  // namespace fathom::gui
