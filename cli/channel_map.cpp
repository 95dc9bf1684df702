#include "cli/channel_map.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>

#include "base/error.h"
#include "cli/channel_presets.h"
#include "deep/volume.h"

namespace fathom::cli {

namespace {

// The ends of channel names, by the component they stand for.
constexpr std::array<std::array<std::string_view, 5>, 3> kEnds = {
    {{"R", "r", "red", "X", "x"}, {"G", "g", "green", "Y", "y"}, {"B", "b", "blue", "Z", "z"}}};

constexpr std::array<std::string_view, 16> kColourLayers = {
    "RGB",      "diffuse",          "specular",          "albedo",
    "variance", "variance.diffuse", "variance.specular", "variance.albedo",
    "half0",    "half0.diffuse",    "half0.specular",    "half0.albedo",
    "half1",    "half1.diffuse",    "half1.specular",    "half1.albedo"};
constexpr std::array<std::string_view, 2> kVectorLayers = {"N", "variance.N"};

template <size_t n>
bool contains(const std::array<std::string_view, n>& list, std::string_view name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

std::string ourChannel(const std::string& layer, size_t component) {
  const size_t end = contains(kVectorLayers, layer) ? 3 : 0;
  return (layer == "RGB" ? "" : layer + ".") + std::string(kEnds[component][end]);
}

// The name that a layer's component has in the file, if it has one.
std::optional<std::string> theirChannel(const std::string& layer, size_t component,
                                        std::span<const std::string> channels) {
  for (const std::string_view end : kEnds[component]) {
    std::string name = layer == "RGB" ? std::string(end) : layer + "." + std::string(end);
    if (std::find(channels.begin(), channels.end(), name) != channels.end()) return name;
  }
  return {};
}

// One channel of ours, or nothing where none of its terms is in the file.
std::optional<MappedChannel> resolveChannel(const ChannelMap& map, const ChannelMap::Line& line,
                                            const std::string& ours, std::optional<size_t> component,
                                            std::span<const std::string> channels) {
  MappedChannel result{ours, {}, line.unpremultiplied};
  std::string absent;
  for (const ChannelMap::Term& term : line.terms) {
    const bool there = std::find(channels.begin(), channels.end(), term.theirs) != channels.end();
    const std::optional<std::string> name = component ? theirChannel(term.theirs, *component, channels)
                                            : there   ? std::optional(term.theirs)
                                                      : std::nullopt;
    if (name)
      result.terms.push_back({term.sign, *name});
    else
      absent = term.theirs;
  }
  if (result.terms.empty()) return {};
  if (!absent.empty())
    fail("channel map {}, {}: expected {} in the file beside {}, found none", map.name, printable(ours),
         printable(absent), printable(result.terms.front().theirs));
  return result;
}

bool isRename(const MappedChannel& channel) {
  return channel.terms.size() == 1 && channel.terms[0].sign > 0;
}

// The channels of the file that go by another name after the map.
std::set<std::string> renamed(std::span<const MappedChannel> map) {
  std::set<std::string> result;
  for (const MappedChannel& channel : map)
    if (isRename(channel)) result.insert(channel.terms[0].theirs);
  return result;
}

ChannelMap::Line parseLine(const std::string& text) {
  std::istringstream words(text);
  std::string equals, word;
  ChannelMap::Line line;
  if (!(words >> line.ours >> equals) || equals != "=") fail("expected ours = theirs, found '{}'", printable(text));
  float sign = 1;
  bool termNext = true;
  while (words >> word) {
    if (termNext) {
      line.terms.push_back({sign, word});
    } else if (word == "unpremultiplied") {
      line.unpremultiplied = true;
      if (words >> word) fail("expected nothing after unpremultiplied, found '{}'", printable(word));
      break;
    } else if (word == "+" || word == "-") {
      sign = word == "+" ? 1.0f : -1.0f;
    } else {
      fail("expected + or - between channels, found '{}'", printable(word));
    }
    termNext = !termNext;
  }
  if (termNext && !line.unpremultiplied) fail("expected a channel at the end, found '{}'", printable(text));
  return line;
}

}  // namespace

ChannelMap parseChannelMap(const std::string& name, const std::string& text) {
  ChannelMap map{name, {}};
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    line.erase(std::min(line.find('#'), line.size()));
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    try {
      map.lines.push_back(parseLine(line));
    } catch (const Error& e) {
      fail("channel map {}, line {}: {}", name, number, e.what());
    }
  }
  return map;
}

ChannelMap readChannelMap(const std::string& presetOrFile) {
  for (const ChannelPreset& preset : channelPresets())
    if (preset.name == presetOrFile) return parseChannelMap(presetOrFile, std::string(preset.text));
  std::ifstream file(presetOrFile, std::ios::binary);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) {
    std::string names;
    for (const std::string& name : presetNames()) names += (names.empty() ? "" : ", ") + name;
    fail("channel map {}: expected a file that can be read, or one of {}", presetOrFile, names);
  }
  return parseChannelMap(presetOrFile, text.str());
}

std::vector<std::string> presetNames() {
  std::vector<std::string> names;
  for (const ChannelPreset& preset : channelPresets()) names.emplace_back(preset.name);
  return names;
}

std::vector<MappedChannel> resolveMap(const ChannelMap& map, std::span<const std::string> channels) {
  std::vector<MappedChannel> result;
  for (const ChannelMap::Line& line : map.lines) {
    const bool layer = contains(kColourLayers, line.ours) || contains(kVectorLayers, line.ours);
    size_t found = 0;
    for (size_t component = 0; component < (layer ? 3u : 1u); ++component) {
      std::optional<MappedChannel> channel =
          layer ? resolveChannel(map, line, ourChannel(line.ours, component), component, channels)
                : resolveChannel(map, line, line.ours, std::nullopt, channels);
      if (channel) result.push_back(std::move(*channel)), ++found;
    }
    if (layer && found != 0 && found != 3)
      fail("channel map {}, {}: expected three channels in the file, found {}", map.name, line.ours, found);
  }
  return result;
}

std::vector<std::string> mappedNames(std::span<const MappedChannel> map, std::span<const std::string> channels) {
  const std::set<std::string> gone = renamed(map);
  std::vector<std::string> names;
  for (const std::string& name : channels)
    if (!gone.contains(name)) names.push_back(name);
  for (const MappedChannel& channel : map)
    if (std::find(names.begin(), names.end(), channel.ours) == names.end()) names.push_back(channel.ours);
  return names;
}

void applyMap(std::span<const MappedChannel> map, deep::DeepImage& image) {
  std::vector<deep::Channel> made;
  for (const MappedChannel& mapped : map) {
    const bool there = std::all_of(mapped.terms.begin(), mapped.terms.end(),
                                   [&](const ChannelMap::Term& term) { return image.find(term.theirs) != nullptr; });
    if (!there) continue;
    deep::Channel channel{mapped.ours, deep::PixelType::Float, Buffer<float>(image.samples(), 0.0f), {}};
    for (const ChannelMap::Term& term : mapped.terms) {
      const std::span<const float> values = std::as_const(image).get(term.theirs);
      for (size_t i = 0; i < values.size(); ++i) channel.values[i] += term.sign * values[i];
    }
    if (isRename(mapped)) channel.type = image.find(mapped.terms[0].theirs)->type;
    if (mapped.unpremultiplied) {
      const std::span<const float> alpha = std::as_const(image).get("A");
      for (size_t i = 0; i < alpha.size(); ++i) channel.values[i] *= float(deep::opacity(alpha[i]));
    }
    made.push_back(std::move(channel));
  }
  for (const std::string& name : renamed(map)) image.erase(name);
  for (deep::Channel& channel : made) {
    image.erase(channel.name);
    image.channels.push_back(std::move(channel));
  }
}

}  // namespace fathom::cli
