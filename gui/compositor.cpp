#include "gui/compositor.h"

#include <QPainter>
#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/parallel.h"

namespace fathom::gui {

namespace {

constexpr size_t kMostKept = size_t(512) << 20;  // bytes of planes
constexpr size_t kPixelsOfRange = 1 << 16;       // that the ends of false colours are found from
constexpr size_t kMeasurable = 10000;            // pixels whose time tells something

size_t bytesOf(const Seen& seen) {
  return seen.pixels() * sizeof(float) * (seen.values.size() + !seen.alpha.empty() + !seen.ids.empty());
}

bool showsA(Comparison comparison) {
  return comparison != Comparison::B;
}
bool showsB(Comparison comparison) {
  return comparison != Comparison::A;
}

size_t pixelsOf(const Box& box, int step) {
  return box.area() / (size_t(step) * size_t(step)) + 1;
}

// Averages of times x times pixels; those of the last row and column may lack some.
QImage shrunk(const QImage& image, int times) {
  if (times <= 1 || image.isNull()) return image;
  const int width = (image.width() + times - 1) / times, height = (image.height() + times - 1) / times;
  QImage result(width, height, QImage::Format_RGB32);
  uchar* bits = result.bits();
  const qsizetype stride = result.bytesPerLine();
  parallelFor(0, height, [&](int y) {
    QRgb* to = reinterpret_cast<QRgb*>(bits + y * stride);
    const int y1 = std::min((y + 1) * times, image.height());
    for (int x = 0; x < width; ++x) {
      const int x1 = std::min((x + 1) * times, image.width());
      uint32_t red = 0, green = 0, blue = 0, count = 0;
      for (int row = y * times; row < y1; ++row) {
        const QRgb* from = reinterpret_cast<const QRgb*>(image.constScanLine(row));
        for (int column = x * times; column < x1; ++column, ++count)
          red += from[column] >> 16 & 255, green += from[column] >> 8 & 255, blue += from[column] & 255;
      }
      to[x] = 0xff000000u | red / count << 16 | green / count << 8 | blue / count;
    }
  });
  return result;
}

}  // namespace

Comparison comparisonOf(const RenderRequest& request) {
  if (!request.b) return Comparison::A;
  return request.a ? request.state.comparison : Comparison::B;
}

SeenPtr Compositor::find(const PicturePtr& picture, const RenderRequest& request, int step) const {
  const Layer* layer = picture->layer(request.state.layer);
  for (const Kept& kept : kept_) {
    const Seen& seen = *kept.seen;
    const bool same = picture->flat() || (kept.clip == request.state.clip && kept.overlay == request.overlay);
    if (kept.picture.lock() == picture && same && layer && seen.layer.name == layer->name && seen.step == step &&
        seen.box == request.box)
      return kept.seen;
  }
  return nullptr;
}

SeenPtr Compositor::seen(const PicturePtr& picture, const RenderRequest& request, int step, const Progress& progress) {
  if (SeenPtr there = find(picture, request, step)) return there;
  const auto begin = std::chrono::steady_clock::now();
  SeenPtr made = std::make_shared<const Seen>(
      see(*picture, request.state.layer, request.state.clip, request.box, step, progress, request.overlay.get()));
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  if (made->pixels() >= kMeasurable) secondsPerPixel_ = took.count() / double(made->pixels());
  // What only another clip tells from it is of no more use: a plane that is dragged goes on.
  std::erase_if(kept_, [&](const Kept& kept) {
    return kept.picture.lock() == picture && kept.seen->layer.name == made->layer.name && kept.seen->step == step &&
           kept.seen->box == request.box;
  });
  kept_.push_front({picture, request.state.clip, request.overlay, made});
  size_t bytes = 0;
  std::erase_if(kept_, [&](const Kept& kept) {
    bytes += bytesOf(*kept.seen);
    return kept.picture.expired() || (bytes > kMostKept && kept.seen != made);
  });
  return made;
}

ValueRange Compositor::range(const PicturePtr& picture, const std::string& layer, const Progress& progress) {
  const Layer* of = picture->layer(layer);
  if (of && !hasFalseColours(of->kind)) return {};
  std::erase_if(ranges_, [](const KeptRange& kept) { return kept.picture.expired(); });
  for (const KeptRange& kept : ranges_)
    if (kept.picture.lock() == picture && kept.layer == layer) return kept.range;
  const Box& window = picture->dataWindow();
  const int step = 1 + int(std::sqrt(double(window.area()) / double(kPixelsOfRange)));
  const ValueRange range = rangeOf(see(*picture, layer, {}, window, step, progress));
  ranges_.push_back({picture, layer, range});
  return range;
}

double Compositor::estimate(const RenderRequest& request, int step) const {
  const Comparison comparison = comparisonOf(request);
  double pixels = 0;
  if (showsA(comparison) && !find(request.a, request, step)) pixels += double(pixelsOf(request.box, step));
  if (showsB(comparison) && !find(request.b, request, step)) pixels += double(pixelsOf(request.box, step));
  return pixels * secondsPerPixel_;
}

Rendered Compositor::make(const RenderRequest& request, int step, const Progress& progress) {
  const Comparison comparison = comparisonOf(request);
  Rendered made;
  made.request = request;
  made.step = step;
  if (showsA(comparison)) made.seenA = seen(request.a, request, step, progress);
  if (showsB(comparison)) made.seenB = seen(request.b, request, step, progress);
  if (comparison == Comparison::Difference) {
    made.compared = std::make_shared<const Seen>(differenceOf(*made.seenA, *made.seenB, request.state.isolate));
    made.a = colourDifference(*made.compared, request.state);
  } else if (comparison == Comparison::RelativeError) {
    made.compared = std::make_shared<const Seen>(relativeErrorOf(*made.seenA, *made.seenB, request.state.isolate));
    made.a = colourRelativeError(*made.compared, request.state);
  } else {
    // B's false colours mean the same as A's.
    made.ends = range(request.a ? request.a : request.b, request.state.layer, progress);
    if (made.seenA) made.a = colour(*made.seenA, request.state, made.ends, *display_);
    if (made.seenB) made.b = colour(*made.seenB, request.state, made.ends, *display_);
  }
  const int times = std::max(1, request.step * request.shrink / step);
  made.pixelSize = step * times;
  made.a = shrunk(made.a, times);
  made.b = shrunk(made.b, times);
  return made;
}

QImage joined(const Rendered& rendered, double wipe) {
  const QImage &a = rendered.a, &b = rendered.b;
  if (a.isNull() || b.isNull()) return a.isNull() ? b : a;
  if (comparisonOf(rendered.request) == Comparison::Wipe) {
    const double line = (wipe - rendered.request.box.x0) / rendered.pixelSize;
    const int column = int(std::lround(std::clamp(line, 0.0, double(a.width()))));
    QImage both = a;
    QPainter(&both).drawImage(column, 0, b, column, 0);
    return both;
  }
  QImage both(a.width() + b.width(), std::max(a.height(), b.height()), QImage::Format_RGB32);
  both.fill(Qt::black);
  QPainter painter(&both);
  painter.drawImage(0, 0, a);
  painter.drawImage(a.width(), 0, b);
  return both;
}

}  // namespace fathom::gui
