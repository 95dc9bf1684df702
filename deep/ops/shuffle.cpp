#include "deep/ops/shuffle.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"

namespace fathom::deep {

namespace {

bool hasStar(std::string_view pattern) {
  return pattern.find('*') != std::string_view::npos;
}

// What the star of a pattern stands for in a name that matches.
std::string starOf(std::string_view pattern, std::string_view name) {
  return std::string(name.substr(pattern.find('*'), name.size() - (pattern.size() - 1)));
}

std::string withStar(const std::string& pattern, const std::string& star) {
  std::string name = pattern;
  return name.replace(name.find('*'), 1, star);
}

// The copies by name.
std::vector<ChannelCopy> copiesOf(const DeepImage& image, const ChannelCopy& copy) {
  if (hasStar(copy.to) != hasStar(copy.from))
    fail("shuffle: expected a * in both names or in neither, found {}:{}", copy.to, copy.from);
  if (!hasStar(copy.from)) return {copy};
  std::vector<ChannelCopy> result;
  for (const Channel& channel : image.channels)
    if (matches(copy.from, channel.name))
      result.push_back({withStar(copy.to, starOf(copy.from, channel.name)), channel.name});
  if (result.empty()) fail("channel {}: expected in the image, found none", copy.from);
  return result;
}

Channel copyOf(const DeepImage& image, const ChannelCopy& copy) {
  const Channel* from = image.find(copy.from);
  if (!from) fail("channel {}: expected in the image, found none", copy.from);
  const bool needsNumbers = copy.to == "A" || copy.to == "Z" || copy.to == "ZBack";
  if (needsNumbers && from->type == PixelType::Uint)
    fail("channel {}: expected FLOAT or HALF, found UINT in {}", copy.to, copy.from);
  return {copy.to, from->type, from->values.copy(), from->ids.copy()};
}

void copyChannels(DeepImage& image, const std::vector<ChannelCopy>& map) {
  std::vector<Channel> copies;
  for (const ChannelCopy& pattern : map)
    for (const ChannelCopy& copy : copiesOf(image, pattern)) {
      if (copy.to.empty()) fail("shuffle: expected a name for the copy of channel {}, found none", copy.from);
      if (std::ranges::find(copies, copy.to, &Channel::name) != copies.end())
        fail("channel {}: expected one source, found {} as another", copy.to, copy.from);
      copies.push_back(copyOf(image, copy));
    }
  for (Channel& copy : copies) {
    image.erase(copy.name);
    image.channels.push_back(std::move(copy));
  }
}

bool anyMatches(const std::vector<std::string>& patterns, const std::string& name) {
  return std::ranges::any_of(patterns, [&](const std::string& pattern) { return matches(pattern, name); });
}

void expectAll(const DeepImage& image, const std::vector<std::string>& names) {
  for (const std::string& name : names)
    if (!hasStar(name) && !image.find(name)) fail("channel {}: expected in the image, found none", name);
}

void setConstant(DeepImage& image, const ChannelConstant& constant) {
  const double value = constant.value;
  Channel* channel = image.find(constant.name);
  if (!channel) channel = &image.add(constant.name, PixelType::Float);
  if (channel->type != PixelType::Uint) return channel->values.fill(float(value));
  if (!(value >= 0 && value <= std::numeric_limits<uint32_t>::max() && value == std::floor(value)))
    fail("channel {}: expected a whole number from 0 to 4294967295, since it is UINT, found {}", constant.name, value);
  channel->ids.fill(uint32_t(value));
}

}  // namespace

bool matches(std::string_view pattern, std::string_view name) {
  const size_t star = pattern.find('*');
  if (star == std::string_view::npos) return pattern == name;
  return name.size() + 1 >= pattern.size() && name.starts_with(pattern.substr(0, star)) &&
         name.ends_with(pattern.substr(star + 1));
}

DeepImage shuffle(DeepImage image, const Shuffle& how) {
  copyChannels(image, how.map);
  expectAll(image, how.keep);
  expectAll(image, how.drop);
  std::erase_if(image.channels, [&](const Channel& channel) {
    return (!how.keep.empty() && !anyMatches(how.keep, channel.name)) || anyMatches(how.drop, channel.name);
  });
  for (const ChannelConstant& constant : how.set) setConstant(image, constant);
  return image;
}

}  // namespace fathom::deep
