#include "gui/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>

#include "base/parallel.h"
#include "cli/chain_source.h"
#include "deep/channels.h"
#include "flat/finite.h"

namespace fathom::gui {

namespace {

struct NamedChannel {
  std::string name;
  bool identifier;
};

// "diffuse" of "diffuse.R"; empty for a channel without a dot.
std::string prefixOf(const std::string& channel) {
  const size_t dot = channel.rfind('.');
  return dot == channel.npos ? "" : channel.substr(0, dot);
}

std::string suffixOf(const std::string& channel) {
  return channel.substr(channel.rfind('.') + 1);  // npos + 1 == 0
}

// The places of these suffixes among `channels`, where all of them are there.
std::vector<std::string> triple(const std::vector<std::string>& channels, const std::array<const char*, 3>& suffixes) {
  std::vector<std::string> result;
  for (const char* suffix : suffixes) {
    const auto found = std::ranges::find(channels, suffix, suffixOf);
    if (found == channels.end()) return {};
    result.push_back(*found);
  }
  return result;
}

Layer::Kind scalarKind(const std::string& name) {
  if (name.starts_with("variance.") || name.find(".variance") != name.npos) return Layer::Kind::Variance;
  return name == "Z" || name == "ZBack" || name.starts_with("Z.") ? Layer::Kind::Depth : Layer::Kind::Scalar;
}

// The layers of the channels that share a prefix.
void addLayers(const std::string& prefix, std::vector<std::string> channels, std::vector<Layer>& layers) {
  using Kind = Layer::Kind;
  const bool variance = prefix == "variance" || prefix.starts_with("variance.");
  std::vector<std::string> colour = triple(channels, {"R", "G", "B"});
  const std::vector<std::string> vector = triple(channels, {"X", "Y", "Z"});
  const auto remove = [&](const std::vector<std::string>& names) {
    std::erase_if(channels, [&](const std::string& name) { return std::ranges::count(names, name) > 0; });
  };
  if (!colour.empty()) {
    remove(colour);
    const auto alpha = std::ranges::find(channels, "A", suffixOf);
    if (alpha != channels.end()) {
      colour.push_back(*alpha);
      channels.erase(alpha);
    }
    layers.push_back({prefix.empty() ? (colour.size() > 3 ? "RGBA" : "RGB") : prefix, colour,
                      variance ? Kind::Variance : Kind::Colour});
  }
  if (!vector.empty() && !prefix.empty()) {
    remove(vector);
    layers.push_back({prefix, vector, variance ? Kind::Variance : Kind::Vector});
  }
  // Grey; beside an X it is a direction's or a place's.
  const auto grey = std::ranges::find(channels, "Y", suffixOf);
  if (grey != channels.end() && scalarKind(*grey) == Kind::Scalar && !std::ranges::count(channels, "X", suffixOf)) {
    layers.push_back({*grey, {*grey}, Kind::Colour});
    channels.erase(grey);
  }
  for (const std::string& channel : channels) layers.push_back({channel, {channel}, scalarKind(channel)});
}

std::vector<Layer> layersOf(const std::vector<NamedChannel>& channels) {
  std::map<std::string, std::vector<std::string>> byPrefix;
  std::vector<Layer> identifiers, layers;
  for (const NamedChannel& channel : channels)
    if (channel.identifier)
      identifiers.push_back({channel.name, {channel.name}, Layer::Kind::Identifier});
    else
      byPrefix[prefixOf(channel.name)].push_back(channel.name);
  for (auto& [prefix, names] : byPrefix) addLayers(prefix, std::move(names), layers);  // "" comes first
  layers.insert(layers.end(), identifiers.begin(), identifiers.end());
  return layers;
}

bool anyNonFinite(std::span<const float> values, bool depths) {
  constexpr size_t kRun = 4096;  // counted without a look at each, so that many are counted at once
  for (size_t first = 0; first < values.size(); first += kRun) {
    size_t count = 0;
    for (const float value : values.subspan(first, std::min(kRun, values.size() - first)))
      count += depths ? std::isnan(value) : !isFinite(value);
    if (count > 0) return true;
  }
  return false;
}

// Looks at the values of each layer; valuesOf(channel) are a channel's.
template <class ValuesOf>
void findNonFinite(std::vector<Layer>& layers, const ValuesOf& valuesOf) {
  parallelFor(0, int(layers.size()), [&](int i) {
    Layer& layer = layers[size_t(i)];
    layer.nonFinite = std::ranges::any_of(layer.channels, [&](const std::string& channel) {
      return anyNonFinite(valuesOf(channel), layer.kind == Layer::Kind::Depth);
    });
  });
}

}  // namespace

const Box& Picture::dataWindow() const {
  return std::visit([](const auto& of) -> const Box& { return of.dataWindow; }, image);
}

const Box& Picture::displayWindow() const {
  return std::visit([](const auto& of) -> const Box& { return of.displayWindow; }, image);
}

const Layer* Picture::layer(const std::string& name) const {
  const auto found = std::ranges::find(layers, name, &Layer::name);
  if (found != layers.end()) return &*found;
  return layers.empty() ? nullptr : layers.data();
}

size_t Picture::bytes() const {
  size_t bytes = sizeof(Picture);
  if (const flat::Image* of = flat()) bytes += of->planes.size() * of->dataWindow.area() * sizeof(float);
  if (const deep::DeepImage* of = deep())
    bytes += of->offsets.size() * sizeof(uint64_t) + of->channels.size() * of->samples() * sizeof(float);
  return bytes;
}

std::vector<Layer> layersOf(const deep::DeepImage& image) {
  std::vector<NamedChannel> channels;
  for (const deep::Channel& channel : image.channels)
    channels.push_back({channel.name, channel.type == deep::PixelType::Uint});
  std::vector<Layer> layers = layersOf(channels);
  findNonFinite(layers, [&](const std::string& channel) { return image.tryGet(channel); });
  layers.push_back({"samples per pixel", {}, Layer::Kind::Count});
  return layers;
}

std::vector<Layer> layersOf(const flat::Image& image) {
  std::vector<NamedChannel> channels;
  for (const flat::Plane& plane : image.planes) channels.push_back({plane.name, false});
  std::vector<Layer> layers = layersOf(channels);
  findNonFinite(layers,
                [&](const std::string& channel) -> std::span<const float> { return image.get(channel).values; });
  return layers;
}

PicturePtr makePicture(std::string path, std::variant<deep::DeepImage, flat::Image> image) {
  std::vector<Layer> layers = std::visit([](const auto& of) { return layersOf(of); }, image);
  return std::make_shared<Picture>(Picture{std::move(path), std::move(image), std::move(layers)});
}

PicturePtr loadPicture(const std::string& path, size_t memory, const Progress& progress) {
  progress.at(0);
  cli::ChainSource source(path, {}, memory);
  const Box window = source.dataWindow();
  PicturePtr picture = makePicture(path, source.read(window.y0, window.y1));
  progress.at(1);
  return picture;
}

}  // namespace fathom::gui
