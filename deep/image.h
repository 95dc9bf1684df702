// A deep image: per pixel any number of samples, per sample one value in each channel.
//
// Samples lie in pixel order (rows from the top), within a pixel in the file's order; `tidy`, `cluster` and
// `sortSamples` make it front to back. The samples of neighbouring pixels of a row are neighbours in memory: kernels
// feed on that.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/buffer.h"
#include "deep/attributes.h"
#include "flat/box.h"
#include "flat/exr_types.h"

namespace fathom::deep {

using fathom::PixelType;

// One plane over all samples. HALF is held as float (exactly) and written as HALF again; UINT stays UINT.
struct Channel {
  std::string name;
  PixelType type = PixelType::Float;
  Buffer<float> values;  // Half, Float
  Buffer<uint32_t> ids;  // Uint

  size_t size() const { return type == PixelType::Uint ? ids.size() : values.size(); }
};

struct DeepImage {
  Box dataWindow;
  Box displayWindow;
  Buffer<uint64_t> offsets;  // dataWindow.area() + 1 running sample counts, offsets[0] = 0
  std::vector<Channel> channels;
  Attributes attributes;

  size_t pixels() const { return dataWindow.area(); }
  size_t samples() const { return offsets.empty() ? 0 : size_t(offsets[pixels()]); }
  size_t count(size_t pixel) const { return size_t(offsets[pixel + 1] - offsets[pixel]); }

  const Channel* find(std::string_view name) const;
  Channel* find(std::string_view name);
  // The values of a FLOAT or HALF channel; an Error names the channel when it is missing or UINT.
  std::span<const float> get(std::string_view name) const;
  std::span<float> get(std::string_view name);
  // The values, or an empty span where the channel is missing or UINT.
  std::span<const float> tryGet(std::string_view name) const;
  // Adds an uninitialised channel over samples(), or replaces the one with that name.
  Channel& add(std::string name, PixelType type);
  void erase(std::string_view name);
  DeepImage copy() const;
  // The same windows, offsets and attributes without channels.
  DeepImage copyLayout() const;
};

// The rows [y0, y1) of an image as an image of its own; the data window shrinks, the display window stays.
DeepImage rows(const DeepImage& image, int y0, int y1);

}  // namespace fathom::deep
