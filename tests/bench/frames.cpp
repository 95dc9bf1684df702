#include "tests/bench/frames.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace fathom::bench {
namespace {

int mirrored(int i, int size) {
  const int place = i % (2 * size);
  return place < size ? place : 2 * size - 1 - place;
}

// The image whose pixel p is pixel source(p) of another, over `window`; a source of kNothing leaves the pixel empty.
constexpr size_t kNothing = ~size_t(0);
template <class Source>
deep::DeepImage gathered(const deep::DeepImage& image, const Box& window, const Source& source) {
  deep::DeepImage result;
  result.dataWindow = result.displayWindow = window;
  result.attributes = image.attributes;
  result.offsets = Buffer<uint64_t>(window.area() + 1);
  result.offsets[0] = 0;
  for (size_t p = 0; p < window.area(); ++p)
    result.offsets[p + 1] = result.offsets[p] + (source(p) == kNothing ? 0 : image.count(source(p)));
  for (const deep::Channel& from : image.channels) {
    deep::Channel& to = result.add(from.name, from.type);
    const auto copy = [&](const auto& values, auto& out) {
      for (size_t p = 0; p < window.area(); ++p)
        if (const size_t q = source(p); q != kNothing)
          std::copy_n(values.data() + image.offsets[q], image.count(q), out.data() + result.offsets[p]);
    };
    from.type == deep::PixelType::Uint ? copy(from.ids, to.ids) : copy(from.values, to.values);
  }
  return result;
}

// A tenth of the window's area, in its middle and of its shape.
Box middleTenth(const Box& window) {
  const int width = int(std::lround(window.width() * std::sqrt(0.1)));
  const int height = int(std::lround(window.height() * std::sqrt(0.1)));
  const int x0 = window.x0 + (window.width() - width) / 2, y0 = window.y0 + (window.height() - height) / 2;
  return {x0, y0, x0 + width, y0 + height};
}

}  // namespace

deep::DeepImage tiled(const deep::DeepImage& image, int width, int height) {
  const int w = image.dataWindow.width(), h = image.dataWindow.height();
  return gathered(image, {0, 0, width, height}, [&](size_t p) {
    const int x = int(p % size_t(width)), y = int(p / size_t(width));
    return size_t(mirrored(y, h)) * size_t(w) + size_t(mirrored(x, w));
  });
}

deep::DeepImage nineTenthsEmpty(const deep::DeepImage& image) {
  const Box kept = middleTenth(image.dataWindow);
  const auto width = size_t(image.dataWindow.width());
  return gathered(image, image.dataWindow, [&](size_t p) {
    const int x = image.dataWindow.x0 + int(p % width), y = image.dataWindow.y0 + int(p / width);
    return kept.contains(x, y) ? p : kNothing;
  });
}

deep::DeepImage nineTenthsClean(const deep::DeepImage& image) {
  const Box& window = image.dataWindow;
  const Box kept = middleTenth(window);
  deep::DeepImage result = image.copy();
  for (deep::Channel& channel : result.channels) {
    const bool half = channel.name.starts_with("half0.") || channel.name.starts_with("half1.");
    if (!half && !channel.name.starts_with("variance.")) continue;
    const std::span<const float> mean = half ? image.tryGet(channel.name.substr(6)) : std::span<const float>();
    const float share = channel.name.ends_with(".samples") ? 0.5f : 1;
    for (size_t p = 0; p < window.area(); ++p) {
      const int x = window.x0 + int(p % size_t(window.width())), y = window.y0 + int(p / size_t(window.width()));
      if (kept.contains(x, y)) continue;
      for (size_t s = image.offsets[p]; s < image.offsets[p + 1]; ++s)
        channel.values[s] = mean.empty() ? 0 : share * mean[s];
    }
  }
  return result;
}

}  // namespace fathom::bench
