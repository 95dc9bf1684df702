// Deep images of random values for tests of files: every type, empty pixels, odd bits.
#pragma once

#include <bit>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::reference {

struct NamedType {
  std::string name;
  deep::PixelType type;
};

// 0 to `most` samples a pixel, whole rows without any among them. FLOAT and HALF hold NaN and infinities, UINT all
// bits.
inline deep::DeepImage randomDeep(const Box& dataWindow, const Box& displayWindow,
                                  const std::vector<NamedType>& channels, unsigned seed = 1, unsigned most = 5) {
  std::mt19937 random(seed);
  deep::DeepImage image;
  image.dataWindow = dataWindow;
  image.displayWindow = displayWindow;
  image.offsets = Buffer<uint64_t>(dataWindow.area() + 1);
  image.offsets[0] = 0;
  for (size_t i = 0; i < dataWindow.area(); ++i) {
    const bool emptyRow = i / size_t(dataWindow.width()) % 7 == 3;
    image.offsets[i + 1] = image.offsets[i] + (emptyRow ? 0 : random() % (most + 1));
  }
  const float odd[] = {
      0.0f, -0.0f, 1.0f, -2.5f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()};
  for (const NamedType& c : channels) {
    deep::Channel& channel = image.add(c.name, c.type);
    for (uint32_t& id : channel.ids) id = uint32_t(random());
    for (float& value : channel.values) {
      const unsigned kind = unsigned(random() % 16);
      if (kind < std::size(odd)) value = odd[kind];
      // Any bits that a half can hold have ten of mantissa.
      else
        value = float(int(random() % 2048) - 1024) / float(1u << random() % 12);
    }
  }
  return image;
}

// The first difference in windows, offsets or channels, by name and in bits; empty where there is none.
inline std::string difference(const deep::DeepImage& a, const deep::DeepImage& b) {
  if (a.dataWindow != b.dataWindow) return "data window";
  if (a.displayWindow != b.displayWindow) return "display window";
  if (std::memcmp(a.offsets.data(), b.offsets.data(), 8 * (a.pixels() + 1)) != 0) return "offsets";
  if (a.channels.size() != b.channels.size()) return "number of channels";
  for (const deep::Channel& channel : a.channels) {
    const deep::Channel* other = b.find(channel.name);
    if (!other) return channel.name + ": missing";
    if (other->type != channel.type) return channel.name + ": type";
    const bool uint = channel.type == deep::PixelType::Uint;
    const void* x = uint ? static_cast<const void*>(channel.ids.data()) : channel.values.data();
    const void* y = uint ? static_cast<const void*>(other->ids.data()) : other->values.data();
    if (std::memcmp(x, y, 4 * a.samples()) != 0) return channel.name + ": values";
  }
  return {};
}

}  // namespace fathom::reference
