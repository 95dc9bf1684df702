#include "gui/seen.h"

#include <algorithm>
#include <span>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/ops/insert.h"
#include "deep/sample_view.h"

namespace fathom::gui {

namespace {

using Kind = Layer::Kind;

constexpr int kBandRows = 128;  // many of the tiles that clipView shares out

// The channel that says how far the layer covers its pixels; empty: none.
std::string alphaOf(const Picture& picture, const Layer& layer) {
  if (layer.channels.size() == 4) return layer.channels[3];
  const bool there = picture.deep() ? picture.deep()->find("A") != nullptr : picture.flat()->find("A") != nullptr;
  return there ? "A" : "";
}

std::vector<std::string> shownChannels(const Layer& layer) {
  std::vector<std::string> result = layer.channels;
  if (result.size() > 3) result.resize(3);
  return result;
}

// What the planes of some rows are filled from, and where they begin.
struct Band {
  Box box;
  int step;
  size_t first;

  size_t pixels(const Seen& seen) const { return size_t((box.height() + step - 1) / step) * size_t(seen.width); }
};

void compositeBand(const deep::DeepImage& image, const deep::DepthRange& clip, const std::vector<std::string>& channels,
                   const std::string& alpha, const Band& band, Seen& seen) {
  std::vector<std::string> names;
  std::vector<float*> planes;
  const auto add = [&](const std::string& name, float* plane) {
    names.push_back(name);
    planes.push_back(plane);
  };
  Buffer<float> none;
  float* covered = nullptr;  // where A goes
  for (size_t c = 0; c < channels.size(); ++c)
    if (float* plane = seen.values[c].data() + band.first; channels[c] == "A")
      covered = plane;
    else
      add(channels[c], plane);
  if (!alpha.empty() && alpha != "A") add(alpha, seen.alpha.data() + band.first);
  float* const kept = alpha == "A" ? seen.alpha.data() + band.first : nullptr;
  const size_t pixels = band.pixels(seen);
  if (!covered && !kept) none = Buffer<float>(pixels);
  planes.push_back(kept ? kept : covered ? covered : none.data());
  deep::clipViewInto(image, band.box, band.step, clip, names, planes);
  if (kept && covered) std::copy_n(kept, pixels, covered);
}

void spoilBand(const deep::DeepImage& image, const deep::DepthRange& clip, const Band& band, Seen& seen) {
  std::ranges::copy(deep::findNonFinite(image, band.box, band.step, clip, seen.layer.channels),
                    seen.spoiled.data() + band.first);
}

void countBand(const deep::DeepImage& image, const deep::DepthRange& clip, const Band& band, Seen& seen) {
  std::ranges::transform(deep::countSamples(image, band.box, band.step, clip), seen.values[0].data() + band.first,
                         [](uint32_t count) { return float(count); });
}

void identifyBand(const deep::DeepImage& image, const deep::DepthRange& clip, const std::string& channel,
                  const Band& band, Seen& seen) {
  const Buffer<uint64_t> chosen = deep::mostSeen(image, band.box, band.step, clip);
  const Buffer<uint32_t>& ids = image.find(channel)->ids;
  for (size_t i = 0; i < chosen.size(); ++i)
    if (chosen[i] != deep::kNoSample) seen.ids[band.first + i] = ids[chosen[i]];
}

void takePlane(const flat::Image& image, const std::string& channel, const Band& band, const Seen& seen,
               Buffer<float>& to) {
  const std::span<const float> from = image.get(channel).values;
  const int rows = (band.box.height() + band.step - 1) / band.step;
  parallelFor(0, rows, [&](int row) {
    const int y = band.box.y0 + row * band.step;
    for (int column = 0; column < seen.width; ++column)
      if (const int x = band.box.x0 + column * band.step; image.dataWindow.contains(x, y))
        to[band.first + size_t(row) * size_t(seen.width) + size_t(column)] = from[image.dataWindow.index(x, y)];
  });
}

void takeBand(const flat::Image& image, const std::vector<std::string>& channels, const std::string& alpha,
              const Band& band, Seen& seen) {
  for (size_t c = 0; c < channels.size(); ++c) takePlane(image, channels[c], band, seen, seen.values[c]);
  if (!alpha.empty()) takePlane(image, alpha, band, seen, seen.alpha);
}

// Planes for a layer, to be filled. `zero`: where pixels may be left out.
Seen planesFor(const Layer& layer, const std::string& alpha, const Box& box, int step, bool zero) {
  Seen seen{layer, box, step, (box.width() + step - 1) / step, (box.height() + step - 1) / step};
  const auto plane = [&] { return zero ? Buffer<float>(seen.pixels(), 0.0f) : Buffer<float>(seen.pixels()); };
  const size_t planes = layer.kind == Kind::Count ? 1 : shownChannels(layer).size();
  if (layer.kind == Kind::Identifier)
    seen.ids = Buffer<uint32_t>(seen.pixels(), 0);
  else
    for (size_t c = 0; c < planes; ++c) seen.values.push_back(plane());
  if (!alpha.empty() && layer.kind != Kind::Count && layer.kind != Kind::Identifier) seen.alpha = plane();
  return seen;
}

void fillBand(const deep::DeepImage& image, const deep::DepthRange& clip, const std::string& alpha, const Band& band,
              Seen& seen) {
  const std::vector<std::string> channels = shownChannels(seen.layer);
  if (seen.layer.kind == Kind::Count)
    countBand(image, clip, band, seen);
  else if (seen.layer.kind == Kind::Identifier)
    identifyBand(image, clip, channels[0], band, seen);
  else
    compositeBand(image, clip, channels, alpha, band, seen);
  if (!seen.spoiled.empty()) spoilBand(image, clip, band, seen);
}

// Puts `part` in place of what `whole` has from that column and row on.
void copyInto(const Seen& part, int column, int row, Seen& whole) {
  const auto copy = [&](const auto& from, auto& to) {
    for (int y = 0; y < part.height && !from.empty(); ++y)
      std::copy_n(from.data() + size_t(y) * size_t(part.width), part.width,
                  to.data() + size_t(row + y) * size_t(whole.width) + size_t(column));
  };
  for (size_t c = 0; c < part.values.size(); ++c) copy(part.values[c], whole.values[c]);
  copy(part.alpha, whole.alpha);
  copy(part.ids, whole.ids);
}

// The pixels where the overlay lies, made again with it.
void addOverlay(const deep::DeepImage& image, const Overlay& overlay, const deep::DepthRange& clip,
                const std::string& alpha, const Progress& progress, Seen& seen) {
  const Box there = intersect(seen.box, overlay.window());
  if (there.empty()) return;
  const int step = seen.step, column = (there.x0 - seen.box.x0 + step - 1) / step,
            end = (there.y1 - seen.box.y0 + step - 1) / step;
  std::vector<std::string> names = seen.layer.channels;
  if (!alpha.empty()) names.push_back(alpha);
  for (int row = (there.y0 - seen.box.y0 + step - 1) / step; row < end; row += kBandRows) {
    if (progress.stop.stop_requested()) throw Cancelled();
    const Box rows{seen.box.x0 + column * step, seen.box.y0 + row * step, there.x1,
                   std::min(there.y1, seen.box.y0 + (row + kBandRows) * step)};
    if (rows.empty()) continue;
    const deep::DeepImage part = deep::insertPart(image, *overlay.volume, overlay.move, rows, step, names);
    Seen made = planesFor(seen.layer, alpha, part.dataWindow, 1, false);
    fillBand(part, clip, alpha, {part.dataWindow, 1, 0}, made);
    copyInto(made, column, row, seen);
  }
}

}  // namespace

ptrdiff_t Seen::index(QPoint pixel) const {
  if (!box.contains(pixel.x(), pixel.y())) return -1;
  return ptrdiff_t((pixel.y() - box.y0) / step) * width + (pixel.x() - box.x0) / step;
}

Seen see(const Picture& picture, const std::string& layerName, const deep::DepthRange& clip, const Box& box, int step,
         const Progress& progress, const Overlay* overlay) {
  const Layer* layer = picture.layer(layerName);
  if (!layer) fail("{}: no channel to show", picture.path);
  const std::string alpha = alphaOf(picture, *layer);
  Seen seen = planesFor(*layer, alpha, box, step, !picture.deep());
  if (picture.deep() && layer->nonFinite && layer->kind != Kind::Depth)
    seen.spoiled = Buffer<uint8_t>(seen.pixels(), 0);
  for (int row = 0; row < seen.height; row += kBandRows) {
    progress.at(double(row) / seen.height);
    const Box rows{box.x0, box.y0 + row * step, box.x1, std::min(box.y1, box.y0 + (row + kBandRows) * step)};
    const Band band{rows, step, size_t(row) * size_t(seen.width)};
    if (picture.deep())
      fillBand(*picture.deep(), clip, alpha, band, seen);
    else
      takeBand(*picture.flat(), shownChannels(*layer), alpha, band, seen);
  }
  if (overlay && picture.deep()) addOverlay(*picture.deep(), *overlay, clip, alpha, progress, seen);
  return seen;
}

std::vector<NamedValue> namedValues(const Seen& seen, size_t index, int digits) {
  std::vector<NamedValue> result;
  const auto name = [&](size_t c) {
    const std::string& channel = seen.layer.channels[c];
    return QString::fromStdString(seen.layer.channels.size() > 1 ? channel.substr(channel.rfind('.') + 1) : channel);
  };
  if (!seen.ids.empty()) return {{name(0), QString::number(seen.ids[index])}};
  if (seen.layer.kind == Kind::Count) return {{"samples", QString::number(int64_t(seen.values[0][index]))}};
  for (size_t c = 0; c < seen.values.size(); ++c)
    result.push_back({name(c), QString::number(double(seen.values[c][index]), 'g', digits)});
  if (!seen.alpha.empty()) result.push_back({"A", QString::number(double(seen.alpha[index]), 'g', digits)});
  return result;
}

}  // namespace fathom::gui
