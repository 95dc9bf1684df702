#include "tests/bench/pareto_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <numeric>
#include <random>

#include "base/error.h"
#include "deep/cluster.h"
#include "deep/flat_noisy.h"
#include "deep/io.h"
#include "deep/ppu_scale.h"
#include "flat/io.h"

namespace fathom::bench {
namespace {

// The slots of one pixel that are taken, of `all`; a pixel's samples stand in its first slots.
std::vector<size_t> chosenSlots(size_t pixel, size_t all, size_t count) {
  std::vector<size_t> slots(all);
  std::iota(slots.begin(), slots.end(), size_t(0));
  std::minstd_rand random(unsigned(pixel) * 7919 + 1);
  random.discard(3);
  for (size_t i = 0; i < count; ++i) std::swap(slots[i], slots[i + random() % (all - i)]);
  slots.resize(count);
  std::ranges::sort(slots);
  return slots;
}

double binsPerPixel(const deep::DeepImage& image) {
  return double(image.samples()) / double(image.pixels());
}

void writeFlat(const std::string& path, const deep::DeepImage& bins) {
  std::vector<std::string> names;
  for (const deep::Channel& channel : bins.channels) names.push_back(channel.name);
  flat::Image image = deep::flattenNoisy(bins, deep::findDenoiseInputs(names, bins.attributes));
  if (const auto spp = bins.attributes.getInt("fathom:spp")) image.attributes["fathom:spp"] = fmt::format("{}", *spp);
  flat::write(path, image);
}

ParetoFrame asRendered(const std::string& base, const std::string& scratch) {
  ParetoFrame frame{std::filesystem::path(base).filename().string(),
                    "as rendered",
                    base + ".deep.exr",
                    base + ".flat.exr",
                    base + ".ref.exr",
                    base + ".deepref.exr"};
  const deep::DeepImage bins = deep::read(frame.deep);
  frame.binsPerPixel = binsPerPixel(bins);
  if (!std::filesystem::exists(frame.deepReference)) frame.deepReference.clear();
  if (!std::filesystem::exists(frame.flat)) {
    frame.flat = fmt::format("{}/{}.flat.exr", scratch, frame.name);
    writeFlat(frame.flat, bins);
  }
  return frame;
}

ParetoFrame withFewSamples(const ParetoFrame& rendered, const deep::DeepImage& samples, int count,
                           const std::string& scratch) {
  const std::string base = fmt::format("{}/{}.{}", scratch, rendered.name, count);
  ParetoFrame frame{
      rendered.name, fmt::format("{} samples", count), base + ".deep.exr", base + ".flat.exr", rendered.reference, {}};
  const deep::DeepImage some = someSamples(samples, count);
  const deep::DeepImage bins =
      deep::cluster(some, deep::findBins(some, deep::findPpuScale(some.attributes, some.displayWindow)));
  frame.binsPerPixel = binsPerPixel(bins);
  deep::write(frame.deep, bins);
  writeFlat(frame.flat, bins);
  return frame;
}

}  // namespace

deep::DeepImage someSamples(const deep::DeepImage& samples, int count) {
  const int all = samples.attributes.getInt("fathom:spp").value_or(0);
  if (count < 1 || count > all) fail("fathom:spp: expected at least {} camera samples, found {}", count, all);
  deep::DeepImage result = samples.copyLayout();
  std::vector<size_t> kept;  // by their places in the file
  for (size_t pixel = 0; pixel < samples.pixels(); ++pixel) {
    for (const size_t slot : chosenSlots(pixel, size_t(all), size_t(count)))
      if (slot < samples.count(pixel)) kept.push_back(samples.offsets[pixel] + slot);
    result.offsets[pixel + 1] = kept.size();
  }
  for (const deep::Channel& from : samples.channels) {
    deep::Channel& to = result.add(from.name, from.type);
    for (size_t i = 0; i < kept.size(); ++i)
      from.type == deep::PixelType::Uint ? void(to.ids[i] = from.ids[kept[i]])
                                         : void(to.values[i] = from.values[kept[i]]);
  }
  // Premultiplied by alphas of 1/all of what is seen each, from now on of 1/count.
  const std::vector<float> before(result.get("A").begin(), result.get("A").end());
  const std::span<float> alpha = result.get("A");
  for (size_t pixel = 0; pixel < result.pixels(); ++pixel)
    for (size_t i = result.offsets[pixel], k = 0; i < result.offsets[pixel + 1]; ++i, ++k)
      alpha[i] = float((1.0 / count) / (1.0 - double(k) / count));
  for (deep::Channel& channel : result.channels) {
    const std::string& name = channel.name;
    if (name == "A" || name == "Z" || channel.type == deep::PixelType::Uint) continue;
    for (size_t i = 0; i < kept.size(); ++i)
      if (before[i] > 0) channel.values[i] *= alpha[i] / before[i];
    channel.type = deep::PixelType::Float;
  }
  for (const char* name : {"coc", "lens.U", "lens.V", "time"}) result.erase(name);
  result.attributes.set("fathom:spp", count);
  return result;
}

std::vector<ParetoFrame> findParetoFrames(const std::string& folder, const std::string& scratch) {
  std::vector<std::string> bases;
  const std::string suffix = ".ref.exr";
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string path = entry.path().string();
    if (!path.ends_with(suffix)) continue;
    const std::string base = path.substr(0, path.size() - suffix.size());
    if (std::filesystem::exists(base + ".deep.exr")) bases.push_back(base);
  }
  if (bases.empty()) fail("{}: expected NAME.deep.exr with NAME.ref.exr, found none", folder);
  std::ranges::sort(bases);
  std::vector<ParetoFrame> frames;
  for (const std::string& base : bases) frames.push_back(asRendered(base, scratch));
  for (const int count : {2, 4, 8})
    for (size_t i = 0; i < bases.size(); ++i)
      if (const std::string path = bases[i] + ".samples.exr"; std::filesystem::exists(path))
        frames.push_back(withFewSamples(frames[i], deep::read(path), count, scratch));
  return frames;
}

}  // namespace fathom::bench
