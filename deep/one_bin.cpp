#include "deep/one_bin.h"

#include <charconv>
#include <string>

#include "base/error.h"

namespace fathom::deep {

namespace {

// Names with a blank: no renderer writes them.
const std::string kPixelAlpha = "pixel A";
const std::string kAddedDepth = "added Z";

}  // namespace

DeepImage fromFlat(const flat::Image& image) {
  DeepImage result{image.dataWindow, image.displayWindow, Buffer<uint64_t>(image.dataWindow.area() + 1), {}, {}};
  for (size_t i = 0; i < result.offsets.size(); ++i) result.offsets[i] = i;
  for (const flat::Plane& plane : image.planes) result.add(plane.name, PixelType::Float).values = plane.values.copy();
  const auto spp = image.attributes.find("fathom:spp");
  int count = 0;
  if (spp != image.attributes.end() &&
      std::from_chars(spp->second.data(), spp->second.data() + spp->second.size(), count).ec == std::errc())
    result.attributes.set("fathom:spp", count);
  return result;
}

flat::Image toFlat(const DeepImage& image) {
  flat::Image result{image.dataWindow, image.displayWindow, {}, {}};
  for (const Channel& channel : image.channels) {
    if (channel.type == PixelType::Uint) fail("channel {}: expected FLOAT in a flat image, found UINT", channel.name);
    result.planes.push_back({channel.name, channel.values.copy()});
  }
  return result;
}

void makeOneBin(DeepImage& image) {
  if (Channel* alpha = image.find("A")) alpha->name = kPixelAlpha;
  image.add("A", PixelType::Float).values.fill(1);
  if (image.find("Z")) return;
  image.add("Z", PixelType::Float).values.fill(1);
  image.add(kAddedDepth, PixelType::Float).values.fill(1);
}

void unmakeOneBin(DeepImage& image) {
  image.erase("A");
  if (Channel* alpha = image.find(kPixelAlpha)) alpha->name.assign(1, 'A');
  if (!image.find(kAddedDepth)) return;
  image.erase("Z");
  image.erase(kAddedDepth);
}

}  // namespace fathom::deep
