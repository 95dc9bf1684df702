#include "deep/pick.h"

#include <algorithm>

#include "base/parallel.h"

namespace fathom::deep {

namespace {

constexpr int kRows = 8;  // of a task

// Calls body(pixel of the result, pixel of the image) for the pixels of some rows that the image has.
template <class Body>
void forPixels(const DeepImage& image, const DeepImage& result, const Box& box, int step, int first, int last,
               const Body& body) {
  for (int row = first; row < last; ++row)
    for (int column = 0; column < result.dataWindow.x1; ++column) {
      const int x = box.x0 + column * step, y = box.y0 + row * step;
      if (image.dataWindow.contains(x, y)) body(result.dataWindow.index(column, row), image.dataWindow.index(x, y));
    }
}

}  // namespace

DeepImage pick(const DeepImage& image, const Box& box, int step, const std::vector<std::string>& channels) {
  const Box window{0, 0, (box.width() + step - 1) / step, (box.height() + step - 1) / step};
  DeepImage result{window, window, Buffer<uint64_t>(window.area() + 1, 0), {}, image.attributes};
  parallelRanges(0, window.height(), kRows, [&](int first, int last) {
    forPixels(image, result, box, step, first, last,
              [&](size_t to, size_t from) { result.offsets[to + 1] = image.count(from); });
  });
  for (size_t i = 0; i < window.area(); ++i) result.offsets[i + 1] += result.offsets[i];
  std::vector<std::pair<const Channel*, Channel*>> copies;
  for (const Channel& channel : image.channels)
    if (std::ranges::find(channels, channel.name) != channels.end()) result.add(channel.name, channel.type);
  for (Channel& channel : result.channels) copies.emplace_back(image.find(channel.name), &channel);
  parallelRanges(0, window.height(), kRows, [&](int first, int last) {
    forPixels(image, result, box, step, first, last, [&](size_t to, size_t from) {
      const size_t at = size_t(result.offsets[to]), begin = size_t(image.offsets[from]), count = image.count(from);
      for (const auto& [source, copy] : copies)
        if (source->type == PixelType::Uint)
          std::copy_n(source->ids.data() + begin, count, copy->ids.data() + at);
        else
          std::copy_n(source->values.data() + begin, count, copy->values.data() + at);
    });
  });
  return result;
}

}  // namespace fathom::deep
