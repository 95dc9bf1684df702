#include "deep/ops/named_channels.h"

#include <algorithm>

#include "base/error.h"

namespace fathom::deep {

namespace {

bool holds(std::span<const std::string> names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

}  // namespace

std::vector<std::string> channelsNamed(std::span<const std::string> names, std::span<const std::string> available) {
  std::vector<std::string> result;
  for (const std::string& name : names) {
    bool found = false;
    for (const std::string& channel : available) {
      if (channel != name && !channel.starts_with(name + ".")) continue;
      found = true;
      if (!holds(result, channel)) result.push_back(channel);
    }
    if (found) continue;
    std::string all;
    for (const std::string& channel : available) all.append(1, ' ').append(printable(channel));
    fail("expected a channel or a layer, found {}; there are{}", name.empty() ? "no name" : name,
         all.empty() ? " none" : all);
  }
  return result;
}

std::vector<std::string> floatChannels(const DeepImage& image) {
  std::vector<std::string> names;
  for (const Channel& channel : image.channels)
    if (channel.type != PixelType::Uint) names.push_back(channel.name);
  return names;
}

std::vector<std::string> statisticsOf(const DeepImage& image, std::span<const std::string> channels) {
  std::vector<std::string> result;
  for (const Channel& channel : image.channels)
    for (const std::string_view prefix : {"variance.", "half0.", "half1."})
      if (channel.name.starts_with(prefix) && holds(channels, channel.name.substr(prefix.size())) &&
          !holds(channels, channel.name))
        result.push_back(channel.name);
  return result;
}

}  // namespace fathom::deep
