#include "deep/image.h"

#include <algorithm>
#include <utility>

#include "base/error.h"

namespace fathom::deep {

namespace {

Channel copyRange(const Channel& channel, size_t begin, size_t end) {
  Channel result{channel.name, channel.type, {}, {}};
  if (channel.type == PixelType::Uint) {
    result.ids = Buffer<uint32_t>(end - begin);
    std::copy(channel.ids.begin() + begin, channel.ids.begin() + end, result.ids.begin());
  } else {
    result.values = Buffer<float>(end - begin);
    std::copy(channel.values.begin() + begin, channel.values.begin() + end, result.values.begin());
  }
  return result;
}

}  // namespace

const Channel* DeepImage::find(std::string_view name) const {
  const auto it = std::find_if(channels.begin(), channels.end(), [&](const Channel& c) { return c.name == name; });
  return it == channels.end() ? nullptr : &*it;
}

Channel* DeepImage::find(std::string_view name) {
  return const_cast<Channel*>(std::as_const(*this).find(name));
}

std::span<const float> DeepImage::get(std::string_view name) const {
  const Channel* channel = find(name);
  if (!channel) fail("channel {}: expected in the image, found none", printable(std::string(name)));
  if (channel->type == PixelType::Uint)
    fail("channel {}: expected FLOAT or HALF, found UINT", printable(std::string(name)));
  return channel->values;
}

std::span<float> DeepImage::get(std::string_view name) {
  const std::span<const float> values = std::as_const(*this).get(name);
  return {const_cast<float*>(values.data()), values.size()};
}

std::span<const float> DeepImage::tryGet(std::string_view name) const {
  const Channel* channel = find(name);
  if (!channel || channel->type == PixelType::Uint) return {};
  return channel->values;
}

Channel& DeepImage::add(std::string name, PixelType type) {
  Channel* channel = find(name);
  if (!channel) channel = &channels.emplace_back();
  *channel = {std::move(name), type, {}, {}};
  if (type == PixelType::Uint)
    channel->ids = Buffer<uint32_t>(samples());
  else
    channel->values = Buffer<float>(samples());
  return *channel;
}

void DeepImage::erase(std::string_view name) {
  std::erase_if(channels, [&](const Channel& c) { return c.name == name; });
}

DeepImage DeepImage::copyLayout() const {
  return {dataWindow, displayWindow, offsets.copy(), {}, attributes};
}

DeepImage DeepImage::copy() const {
  DeepImage result = copyLayout();
  for (const Channel& channel : channels) result.channels.push_back(copyRange(channel, 0, channel.size()));
  return result;
}

DeepImage rows(const DeepImage& image, int y0, int y1) {
  DeepImage result{{image.dataWindow.x0, y0, image.dataWindow.x1, y1}, image.displayWindow, {}, {}, image.attributes};
  const size_t first = image.dataWindow.index(image.dataWindow.x0, y0);
  const size_t pixels = result.dataWindow.area();
  result.offsets = Buffer<uint64_t>(pixels + 1);
  const uint64_t begin = image.offsets[first];
  for (size_t i = 0; i <= pixels; ++i) result.offsets[i] = image.offsets[first + i] - begin;
  for (const Channel& channel : image.channels)
    result.channels.push_back(copyRange(channel, size_t(begin), size_t(begin) + result.samples()));
  return result;
}

}  // namespace fathom::deep
