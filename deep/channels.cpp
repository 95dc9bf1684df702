#include "deep/channels.h"

#include <algorithm>
#include <vector>

#include "deep/volume.h"

namespace fathom::deep {

Role roleOf(std::string_view name, PixelType type) {
  if (type == PixelType::Uint) return Role::Identifier;
  if (name == "Z" || name == "ZBack") return Role::Depth;
  if (name == "A") return Role::Alpha;
  if (name == "samples" || name == "half0.samples" || name == "half1.samples") return Role::Statistic;
  if (name.starts_with("variance.")) return Role::Statistic;
  if (name.starts_with("half0.") || name.starts_with("half1.")) return Role::Half;
  if (name == "coc" || name == "time" || name.starts_with("lens.")) return Role::Plain;
  return Role::Premultiplied;
}

bool holdsStatistics(const DeepImage& image) {
  return image.attributes.getInt("fathom:spp") ||
         std::ranges::any_of(image.channels, [](const Channel& c) { return describesSamples(roleOf(c)); });
}

size_t countNonFinite(const DeepImage& image) {
  std::vector<bool> found(image.samples(), false);
  for (const Channel& channel : image.channels) {
    if (roleOf(channel) != Role::Premultiplied) continue;
    for (size_t i = 0; i < found.size(); ++i)
      if (!isFinite(channel.values[i])) found[i] = true;
  }
  return size_t(std::count(found.begin(), found.end(), true));
}

}  // namespace fathom::deep
