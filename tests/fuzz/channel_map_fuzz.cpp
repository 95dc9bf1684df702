// Any text as a channel map, and behind a NUL the names of a file's channels, a line each: a map or an Error, and an image
// whose channels are those that the map tells.
#include <algorithm>
#include <cstdint>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "cli/channel_map.h"
#include "tests/fuzz/expect.h"

namespace fathom {
namespace {

constexpr size_t kMostChannels = 64;

// At least two samples in every channel; names that begin with a '!' are UINT.
deep::DeepImage makeImage(const std::string& names) {
  deep::DeepImage image{{0, 0, 2, 1}, {0, 0, 2, 1}, Buffer<uint64_t>(3, 0), {}, {}};
  image.offsets[1] = 1;
  image.offsets[2] = 2;
  std::istringstream lines(names);
  for (std::string name; std::getline(lines, name) && image.channels.size() < kMostChannels;) {
    const bool uint = name.starts_with('!');
    if (name.empty()) continue;
    deep::Channel& channel = image.add(name, uint ? deep::PixelType::Uint : deep::PixelType::Float);
    channel.values.fill(0.5f);
    channel.ids.fill(7);
  }
  return image;
}

void mapChannels(const std::string& text, deep::DeepImage image) {
  std::vector<std::string> channels;
  for (const deep::Channel& channel : image.channels) channels.push_back(channel.name);
  const cli::ChannelMap map = cli::parseChannelMap("input", text);
  const std::vector<cli::MappedChannel> mapped = cli::resolveMap(map, channels);
  const std::vector<std::string> told = cli::mappedNames(mapped, channels);
  cli::applyMap(mapped, image);
  std::multiset<std::string> found;
  for (const deep::Channel& channel : image.channels) {
    found.insert(channel.name);
    fuzz::expect(channel.size() == image.samples(), "a value for each sample");
  }
  fuzz::expect(found == std::multiset<std::string>(told.begin(), told.end()), "the channels that the map tells");
}

}  // namespace
}  // namespace fathom

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string input(reinterpret_cast<const char*>(data), size);
  const size_t end = std::min(input.find('\0'), size);
  fathom::fuzz::mayFail(
      [&] { fathom::mapChannels(input.substr(0, end), fathom::makeImage(input.substr(std::min(end + 1, size)))); });
  return 0;
}
