#include "deep/ops/merge.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <tuple>

#include "base/error.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "deep/channels.h"
#include "deep/sample_depths.h"

namespace fathom::deep {

namespace {

using Images = std::span<const DeepImage* const>;

// Which sample of which input; the order of numbers is that of the inputs.
struct Origin {
  static constexpr int kBits = 48;
  uint64_t packed;

  Origin() = default;
  Origin(size_t input, uint64_t sample) : packed(uint64_t(input) << kBits | sample) {}
  size_t input() const { return size_t(packed >> kBits); }
  size_t sample() const { return size_t(packed & ((uint64_t(1) << kBits) - 1)); }
};

struct Placed {
  Range range;
  Origin origin;

  Placed() = default;
  Placed(const Range& at, Origin from) : range(at), origin(from) {}
  bool operator<(const Placed& other) const {
    return std::tie(range.z, range.zBack, origin.packed) <
           std::tie(other.range.z, other.range.zBack, other.origin.packed);
  }
};

// One input as the merge reads it.
struct Input {
  const DeepImage& image;
  SampleDepths depths;

  explicit Input(const DeepImage& from) : image(from), depths(from) {}
};

// The samples of one pixel of the result, front to back, in `placed`. Each input's are mostly so already: they are
// merged run by run.
void placePixel(std::span<const Input> inputs, int x, int y, std::vector<Placed>& placed,
                std::vector<Placed>& scratch) {
  placed.clear();
  for (size_t i = 0; i < inputs.size(); ++i) {
    const DeepImage& image = inputs[i].image;
    if (!image.dataWindow.contains(x, y)) continue;
    const size_t pixel = image.dataWindow.index(x, y), before = placed.size();
    const SampleDepths depths = inputs[i].depths;
    for (size_t s = image.offsets[pixel]; s < image.offsets[pixel + 1]; ++s)
      placed.emplace_back(depths[s], Origin(i, s));
    const auto run = placed.begin() + std::ptrdiff_t(before);
    if (!std::is_sorted(run, placed.end())) std::sort(run, placed.end());
    if (before == 0 || run == placed.end() || run[-1] < *run) continue;
    scratch.resize(placed.size());
    std::merge(placed.begin(), run, run, placed.end(), scratch.begin());
    placed.swap(scratch);
  }
}

bool everyInputHas(Images inputs, const std::string& name) {
  return std::ranges::all_of(inputs, [&](const DeepImage* image) { return image->find(name) != nullptr; });
}

// Whether the result has a channel that only some inputs have.
bool staysAlone(const Channel& channel) {
  return !describesSamples(roleOf(channel));
}

struct NamedType {
  std::string name;
  PixelType type;
};

std::vector<NamedType> channelsOf(Images inputs) {
  std::vector<NamedType> result;
  for (const DeepImage* image : inputs)
    for (const Channel& channel : image->channels) {
      const auto found = std::ranges::find(result, channel.name, &NamedType::name);
      if (found == result.end()) {
        if (staysAlone(channel) || everyInputHas(inputs, channel.name)) result.push_back({channel.name, channel.type});
        continue;
      }
      if ((found->type == PixelType::Uint) != (channel.type == PixelType::Uint))
        fail("channel {}: expected the same type in all images, found UINT and another", channel.name);
      if (channel.type == PixelType::Float) found->type = PixelType::Float;
    }
  return result;
}

// Takes a channel of the result from the inputs that have it.
template <class T>
void take(std::span<const Origin> origins, std::span<const T* const> from, T* out) {
  for (size_t i = 0; i < origins.size(); ++i) {
    const T* values = from[origins[i].input()];
    out[i] = values ? values[origins[i].sample()] : T(0);
  }
}

void takeRow(Images inputs, std::span<const Origin> origins, Channel& channel, size_t at) {
  std::vector<const float*> values;
  std::vector<const uint32_t*> ids;
  for (const DeepImage* image : inputs) {
    const Channel* from = image->find(channel.name);
    if (!from && channel.name == "ZBack") from = image->find("Z");
    values.push_back(from ? from->values.data() : nullptr);
    ids.push_back(from ? from->ids.data() : nullptr);
  }
  if (channel.type == PixelType::Uint)
    take<uint32_t>(origins, ids, channel.ids.data() + at);
  else
    take<float>(origins, values, channel.values.data() + at);
}

DeepImage emptyResult(Images inputs) {
  DeepImage result{inputs[0]->dataWindow, inputs[0]->displayWindow, {}, {}, inputs[0]->attributes};
  for (const DeepImage* image : inputs) {
    image->get("A");
    result.dataWindow = unionOf(result.dataWindow, image->dataWindow);
    result.displayWindow = unionOf(result.displayWindow, image->displayWindow);
  }
  for (const char* name : {"fathom:spp", "deepImageState"}) result.attributes.erase(name);
  result.offsets = Buffer<uint64_t>(result.dataWindow.area() + 1, 0);
  return result;
}

std::vector<const DeepImage*> pointersTo(std::span<const DeepImage> images) {
  std::vector<const DeepImage*> pointers;
  for (const DeepImage& image : images) pointers.push_back(&image);
  return pointers;
}

void checkStop(const std::stop_token& stop) {
  if (stop.stop_requested()) throw Cancelled();
}

}  // namespace

DeepImage merge(std::span<const DeepImage> images) {
  return merge(pointersTo(images));
}

DeepImage merge(Images images, const std::stop_token& stop) {
  if (images.empty()) fail("merge: expected at least one image, found none");
  DeepImage result = emptyResult(images);
  std::vector<Input> inputs;
  for (const DeepImage* image : images) inputs.emplace_back(*image);
  const Box& window = result.dataWindow;
  const size_t width = size_t(window.width());
  std::vector<std::vector<Origin>> rows(size_t(window.height()));
  parallelFor(0, window.height(), [&](int row) {
    checkStop(stop);
    std::vector<Placed> placed, scratch;
    for (size_t x = 0; x < width; ++x) {
      placePixel(inputs, window.x0 + int(x), window.y0 + row, placed, scratch);
      for (const Placed& sample : placed) rows[size_t(row)].push_back(sample.origin);
      result.offsets[size_t(row) * width + x + 1] = placed.size();
    }
  });
  for (size_t i = 0; i < window.area(); ++i) result.offsets[i + 1] += result.offsets[i];
  for (const NamedType& channel : channelsOf(images)) result.add(channel.name, channel.type);
  parallelFor(0, window.height(), [&](int row) {
    checkStop(stop);
    for (Channel& channel : result.channels)
      takeRow(images, rows[size_t(row)], channel, size_t(result.offsets[size_t(row) * width]));
  });
  return result;
}

namespace {

// "diffuse.*" for diffuse.R: what the user ought to know is the layer.
std::string layerOf(const std::string& channel) {
  const size_t dot = channel.find('.');
  return dot == channel.npos ? channel : channel.substr(0, dot) + ".*";
}

std::string listOf(const std::set<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += " " + name;
  return text;
}

}  // namespace

std::vector<std::string> describeMerge(std::span<const DeepImage> images) {
  const std::vector<const DeepImage*> inputs = pointersTo(images);
  std::set<std::string> names;
  for (const DeepImage& image : images)
    for (const Channel& channel : image.channels) names.insert(channel.name);
  std::set<std::string> filled, left;
  for (const std::string& name : names) {
    if (everyInputHas(inputs, name) || name == "ZBack") continue;
    const auto has = std::ranges::find_if(images, [&](const DeepImage& image) { return image.find(name); });
    (staysAlone(*has->find(name)) ? filled : left).insert(layerOf(name));
  }
  std::vector<std::string> lines;
  if (!filled.empty()) lines.push_back("0 where an image does not have it:" + listOf(filled));
  if (!left.empty()) lines.push_back("left out, since not every image has it:" + listOf(left));
  return lines;
}

}  // namespace fathom::deep
