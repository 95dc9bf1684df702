#include "deep/ops/crop.h"

#include <algorithm>

#include "base/parallel.h"

namespace fathom::deep {

namespace {

// A run of pixels in a row that come over together.
struct Run {
  size_t from, to, pixels;  // first pixel in the source and in the result
};

// Copies runs, at most one a row in ascending order; all other pixels of the window are empty.
DeepImage copyRuns(const DeepImage& image, const Box& window, const std::vector<Run>& runs) {
  DeepImage result{window, image.displayWindow, Buffer<uint64_t>(window.area() + 1), {}, image.attributes};
  uint64_t total = 0;
  size_t pixel = 0;
  std::vector<uint64_t> begins;
  for (const Run& run : runs) {
    for (; pixel < run.to; ++pixel) result.offsets[pixel] = total;
    begins.push_back(total);
    for (size_t i = 0; i < run.pixels; ++i, ++pixel)
      result.offsets[pixel] = total + image.offsets[run.from + i] - image.offsets[run.from];
    total += image.offsets[run.from + run.pixels] - image.offsets[run.from];
  }
  for (; pixel <= window.area(); ++pixel) result.offsets[pixel] = total;
  for (const Channel& channel : image.channels) result.add(channel.name, channel.type);
  parallelFor(0, int(runs.size()), [&](int i) {
    const Run& run = runs[size_t(i)];
    const size_t first = size_t(image.offsets[run.from]), last = size_t(image.offsets[run.from + run.pixels]);
    for (size_t c = 0; c < image.channels.size(); ++c) {
      const Channel& in = image.channels[c];
      Channel& out = result.channels[c];
      if (in.type == PixelType::Uint)
        std::copy(in.ids.begin() + first, in.ids.begin() + last, out.ids.begin() + begins[size_t(i)]);
      else
        std::copy(in.values.begin() + first, in.values.begin() + last, out.values.begin() + begins[size_t(i)]);
    }
  });
  return result;
}

}  // namespace

DeepImage toWindow(const DeepImage& image, const Box& window) {
  const Box common = intersect(image.dataWindow, window);
  std::vector<Run> runs;
  for (int y = common.y0; y < common.y1 && common.width() > 0; ++y)
    runs.push_back({image.dataWindow.index(common.x0, y), window.index(common.x0, y), size_t(common.width())});
  return copyRuns(image, window, runs);
}

DeepImage crop(const DeepImage& image, const Box& box, bool outside) {
  const Box& window = image.dataWindow;
  const Box inside = intersect(window, box);
  if (!outside) return toWindow(image, inside.empty() ? Box{window.x0, window.y0, window.x0, window.y0} : inside);
  std::vector<Run> runs;
  const auto keep = [&](int y, int x0, int x1) {
    if (x1 > x0) runs.push_back({window.index(x0, y), window.index(x0, y), size_t(x1 - x0)});
  };
  for (int y = window.y0; y < window.y1; ++y) {
    const bool cut = !inside.empty() && y >= inside.y0 && y < inside.y1;
    keep(y, window.x0, cut ? inside.x0 : window.x1);
    if (cut) keep(y, inside.x1, window.x1);
  }
  return copyRuns(image, window, runs);
}

}  // namespace fathom::deep
