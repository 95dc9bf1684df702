#include "tests/bench/frames.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

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

// What a channel without noise holds: nothing in a variance, half of the mean's count and the mean itself in a half buffer.
struct Clean {
  bool changes = false;
  std::string mean;  // empty: 0
  float share = 1;

  explicit Clean(const std::string& channel) {
    const bool half = channel.starts_with("half0.") || channel.starts_with("half1.");
    changes = half || channel.starts_with("variance.");
    if (half) mean = channel.substr(6);
    if (channel.ends_with(".samples")) share = 0.5f;
  }
};

// The pixels of a window outside of a box.
std::vector<size_t> outside(const Box& window, const Box& kept) {
  std::vector<size_t> result;
  for (int y = window.y0; y < window.y1; ++y)
    for (int x = window.x0; x < window.x1; ++x)
      if (!kept.contains(x, y))
        result.push_back(size_t(y - window.y0) * size_t(window.width()) + size_t(x - window.x0));
  return result;
}

}  // namespace

deep::DeepImage tiled(const deep::DeepImage& image, int width, int height) {
  const int w = image.dataWindow.width(), h = image.dataWindow.height();
  return gathered(image, {0, 0, width, height}, [&](size_t p) {
    const int x = int(p % size_t(width)), y = int(p / size_t(width));
    return size_t(mirrored(y, h)) * size_t(w) + size_t(mirrored(x, w));
  });
}

Box middleOf(const Box& window, double share) {
  const int width = int(std::lround(window.width() * std::sqrt(share)));
  const int height = int(std::lround(window.height() * std::sqrt(share)));
  const int x0 = window.x0 + (window.width() - width) / 2, y0 = window.y0 + (window.height() - height) / 2;
  return {x0, y0, x0 + width, y0 + height};
}

deep::DeepImage keepNoisy(const deep::DeepImage& image, const Box& kept, Rest rest) {
  const std::vector<size_t> others = outside(image.dataWindow, kept);
  if (rest == Rest::empty) {
    std::vector<uint8_t> gone(image.dataWindow.area(), 0);
    for (const size_t p : others) gone[p] = 1;
    return gathered(image, image.dataWindow, [&](size_t p) { return gone[p] ? kNothing : p; });
  }
  deep::DeepImage result = image.copy();
  for (deep::Channel& channel : result.channels) {
    const Clean clean(channel.name);
    if (!clean.changes) continue;
    const std::span<const float> mean = clean.mean.empty() ? std::span<const float>() : image.tryGet(clean.mean);
    for (const size_t p : others)
      for (size_t s = image.offsets[p]; s < image.offsets[p + 1]; ++s)
        channel.values[s] = mean.empty() ? 0 : clean.share * mean[s];
  }
  return result;
}

flat::Image keepNoisy(const flat::Image& image, const Box& kept, Rest rest) {
  const std::vector<size_t> others = outside(image.dataWindow, kept);
  flat::Image result = image.copy();
  for (flat::Plane& plane : result.planes) {
    const Clean clean(plane.name);
    if (rest == Rest::converged && !clean.changes) continue;
    const flat::Plane* mean = rest == Rest::empty || clean.mean.empty() ? nullptr : image.find(clean.mean);
    for (const size_t p : others) plane.values[p] = mean ? clean.share * mean->values[p] : 0;
  }
  return result;
}

}  // namespace fathom::bench
