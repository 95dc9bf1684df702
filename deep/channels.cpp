#include "deep/channels.h"

#include <algorithm>
#include <atomic>
#include <vector>

#include "base/parallel.h"
#include "flat/finite.h"

namespace fathom::deep {

namespace {

bool allFinite(const float* begin, const float* end) {
  int odd = 0;  // counted, not looked for: so the compiler makes vectors of it
  for (const float* v = begin; v < end; ++v) odd += !isFinite(*v);
  return odd == 0;
}

}  // namespace

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
  std::vector<const float*> values;
  for (const Channel& channel : image.channels)
    if (roleOf(channel) == Role::Premultiplied) values.push_back(channel.values.data());
  const size_t width = size_t(image.dataWindow.width());
  std::atomic<size_t> count = 0;
  parallelFor(0, image.dataWindow.height(), [&](int y) {
    const size_t first = size_t(image.offsets[size_t(y) * width]), last = size_t(image.offsets[size_t(y + 1) * width]);
    if (std::ranges::all_of(values, [&](const float* v) { return allFinite(v + first, v + last); })) return;
    for (size_t i = first; i < last; ++i)
      count += size_t(std::ranges::any_of(values, [&](const float* v) { return !isFinite(v[i]); }));
  });
  return count;
}

}  // namespace fathom::deep
