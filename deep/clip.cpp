#include "deep/clip.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "deep/channels.h"
#include "deep/volume.h"

namespace fathom::deep {

namespace {

// A sample that stays, and what of it.
struct Kept {
  size_t sample;
  Range range;
  Part part;
  bool cut;
};

// What of one sample lies in [near, far), or nothing.
std::optional<Kept> keep(size_t sample, const Range& range, float alpha, float near, float far) {
  const Range inside = {std::max(range.z, near), range.isPoint() ? range.z : std::min(range.zBack, far)};
  if (range.isPoint()) {
    if (!(range.z >= near && range.z < far)) return {};
    return Kept{sample, range, {}, false};
  }
  if (!(inside.z < inside.zBack)) return {};
  if (inside == range) return Kept{sample, range, {}, false};
  const double fraction = (double(inside.zBack) - inside.z) / (double(range.zBack) - range.z);
  return Kept{sample, inside, partOf(opacity(alpha), fraction), true};
}

float valueOf(const Channel& channel, Role role, const Kept& kept) {
  const float value = channel.values[kept.sample];
  if (!kept.cut) return value;
  if (channel.name == "Z") return kept.range.z;
  if (channel.name == "ZBack") return kept.range.zBack;
  if (role == Role::Alpha) return float(kept.part.alpha);
  return role == Role::Premultiplied ? float(kept.part.weight * double(value)) : value;
}

}  // namespace

DeepImage clip(const DeepImage& image, float near, float far) {
  const auto alpha = image.get("A"), z = image.get("Z"), zBack = image.tryGet("ZBack");
  DeepImage result{
      image.dataWindow, image.displayWindow, Buffer<uint64_t>(image.pixels() + 1, 0), {}, image.attributes};
  std::vector<Kept> kept;
  bool anyCut = false;
  for (size_t pixel = 0; pixel < image.pixels(); ++pixel) {
    for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i) {
      const Range range = usableRange(z[i], zBack.empty() ? z[i] : zBack[i]);
      if (const auto stays = keep(i, range, alpha[i], near, far)) kept.push_back(*stays), anyCut |= stays->cut;
    }
    result.offsets[pixel + 1] = kept.size();
  }
  for (const Channel& channel : image.channels) {
    const Role role = roleOf(channel);
    if (anyCut && describesSamples(role)) continue;
    Channel& out = result.add(channel.name, channel.type);
    for (size_t k = 0; k < kept.size(); ++k)
      if (channel.type == PixelType::Uint)
        out.ids[k] = channel.ids[kept[k].sample];
      else
        out.values[k] = valueOf(channel, role, kept[k]);
  }
  return result;
}

}  // namespace fathom::deep
