#include "deep/apply_flat.h"

#include <chrono>
#include <string>
#include <utility>

#include "deep/channels.h"
#include "deep/one_bin.h"
#include "flat/finite.h"

namespace fathom::deep {

namespace {

// The pixels as a flat image; the channels are left without values.
flat::Image takeFlat(DeepImage& image) {
  flat::Image result{image.dataWindow, image.displayWindow, {}, {}};
  if (const auto spp = image.attributes.getInt("fathom:spp")) result.attributes["fathom:spp"] = std::to_string(*spp);
  for (Channel& channel : image.channels)
    result.planes.push_back({channel.name, std::exchange(channel.values, Buffer<float>())});
  return result;
}

void giveBack(DeepImage& image, flat::Image& pixels) {
  for (size_t i = 0; i < image.channels.size(); ++i) image.channels[i].values = std::move(pixels.planes[i].values);
}

uint64_t countNonFinitePixels(const flat::Image& pixels) {
  uint64_t count = 0;
  const auto &r = pixels.get("R").values, &g = pixels.get("G").values, &b = pixels.get("B").values;
  for (size_t p = 0; p < r.size(); ++p) count += !isFinite(r[p]) || !isFinite(g[p]) || !isFinite(b[p]);
  return count;
}

bool isComponent(const std::string& name) {
  return name.starts_with("diffuse.") || name.starts_with("specular.");
}

}  // namespace

DeepImage applyFlat(DeepImage image, const flat::Denoiser& denoiser, bool keepStatistics, const Progress& progress,
                    DenoiseStats* stats) {
  const auto start = std::chrono::steady_clock::now();
  unmakeOneBin(image);
  flat::Image pixels = takeFlat(image);
  flat::Image denoised = denoiser(pixels, progress);
  if (stats) {
    stats->counts["pixels"] += image.pixels();
    stats->counts["non-finite samples"] += countNonFinitePixels(pixels);
  }
  for (flat::Plane& plane : denoised.planes)
    if (flat::Plane* to = pixels.find(plane.name)) to->values = std::move(plane.values);
  giveBack(image, pixels);
  std::erase_if(image.channels, [&](const Channel& c) {
    return (isComponent(c.name) && !denoised.find(c.name)) || (!keepStatistics && describesSamples(roleOf(c)));
  });
  makeOneBin(image);
  if (stats) stats->seconds["base"] += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return image;
}

}  // namespace fathom::deep
