#include "deep/layers_results.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "deep/channels.h"
#include "flat/limited.h"

namespace fathom::deep {

namespace {

constexpr float kLeastAlpha = 1e-8f;  // of a layer that has a colour of its own

// A pixel of a layer, in the light of the scene.
struct LayerPixel {
  std::array<float, 3> colour;  // premultiplied
  float alpha, depth;           // depth times alpha
};

class Pixels {
 public:
  explicit Pixels(const LayeredRows& rows) : rows_(rows), scale_(1 / rows.scale.exposure) {}

  int layers() const { return rows_.band.layers(); }

  // y: of the data window; x counts from its left.
  LayerPixel at(int layer, int y, int x) const {
    const auto value = [&](size_t plane) { return rows_.band.row(layer, plane, y - rows_.frame.y0)[x]; };
    const float scale = scale_ * factor(y, x);
    const auto colour = [&](size_t c) { return limited(double(value(c)) * double(scale)); };
    return {{colour(0), colour(1), colour(2)}, value(3), value(4)};
  }

  float emission(size_t c, int y, int x) const {
    return factor(y, x) * rows_.emission[c * rows_.render.size() + place(y, x)];
  }
  float emissionDepth(int y, int x) const { return rows_.emissionDepth[place(y, x)]; }

  // All layers, one over the other: colour and alpha.
  std::array<float, 4> composited(int y, int x) const {
    std::array<float, 4> sum{};
    float passed = 1;
    for (int l = 0; l < layers(); ++l) {
      const LayerPixel pixel = at(l, y, x);
      for (size_t c = 0; c < 3; ++c) sum[c] += passed * pixel.colour[c];
      passed *= 1 - pixel.alpha;
    }
    sum[3] = 1 - passed;
    return sum;
  }

 private:
  size_t place(int y, int x) const { return size_t(y - rows_.y0) * size_t(rows_.frame.width()) + size_t(x); }
  float factor(int y, int x) const { return rows_.factors.empty() ? 1 : rows_.factors[place(y, x)]; }

  const LayeredRows& rows_;
  const float scale_;
};

struct DeepSample {
  std::array<float, 3> colour;
  float alpha, depth;
};

// Layers of a pixel as samples; how many there are.
int samplesOf(const Pixels& pixels, int y, int x, std::array<DeepSample, nn::kMostLayers>& samples) {
  int count = 0;
  for (int l = 0; l < pixels.layers(); ++l) {
    LayerPixel pixel = pixels.at(l, y, x);
    float depth = pixel.alpha > 0 ? pixel.depth / pixel.alpha : pixels.emissionDepth(y, x);
    for (size_t c = 0; c < 3 && l == 0; ++c) pixel.colour[c] += pixels.emission(c, y, x);
    const bool dark = std::ranges::all_of(pixel.colour, [](float c) { return c == 0; });
    if (!(pixel.alpha > 0) && dark) continue;
    if (count > 0)
      depth = std::max(depth, std::nextafter(samples[size_t(count) - 1].depth, std::numeric_limits<float>::infinity()));
    samples[size_t(count++)] = {pixel.colour, pixel.alpha, depth};
  }
  return count;
}

}  // namespace

flat::Image flattenedLayers(const LayeredRows& rows) {
  const Pixels pixels(rows);
  flat::Image result{{rows.frame.x0, rows.y0, rows.frame.x1, rows.y1}, rows.displayWindow, {}, {}};
  for (const char* name : {"R", "G", "B", "A"}) result.add(name);
  const int width = rows.frame.width();
  parallelFor(rows.y0, rows.y1, [&](int y) {
    for (int x = 0; x < width; ++x) {
      const std::array<float, 4> sum = pixels.composited(y, x);
      const size_t i = size_t(y - rows.y0) * size_t(width) + size_t(x);
      for (size_t c = 0; c < 4; ++c)
        result.planes[c].values[i] = c < 3 ? limited(double(sum[c]) + double(pixels.emission(c, y, x))) : sum[c];
    }
  });
  return result;
}

DeepImage layersImage(const LayeredRows& rows, const Attributes& attributes) {
  const Pixels pixels(rows);
  DeepImage result;
  result.dataWindow = {rows.frame.x0, rows.y0, rows.frame.x1, rows.y1};
  result.displayWindow = rows.displayWindow;
  result.attributes = attributes;
  result.attributes.erase("fathom:spp");  // its alphas count no rays
  const int width = rows.frame.width();
  result.offsets = Buffer<uint64_t>(result.dataWindow.area() + 1, uint64_t(0));
  std::array<DeepSample, nn::kMostLayers> samples{};
  const auto forPixels = [&](const auto& body) {
    for (int y = rows.y0; y < rows.y1; ++y)
      for (int x = 0; x < width; ++x)
        body(size_t(y - rows.y0) * size_t(width) + size_t(x), samplesOf(pixels, y, x, samples));
  };
  forPixels([&](size_t i, int count) { result.offsets[i + 1] = result.offsets[i] + uint64_t(count); });
  std::array<float*, 5> to{};
  const char* names[] = {"R", "G", "B", "A", "Z"};
  for (const char* name : names) result.add(name, PixelType::Float);
  for (size_t c = 0; c < to.size(); ++c) to[c] = result.get(names[c]).data();
  forPixels([&](size_t i, int count) {
    for (size_t k = 0; k < size_t(count); ++k) {
      const size_t s = size_t(result.offsets[i]) + k;
      for (size_t c = 0; c < 3; ++c) to[c][s] = samples[k].colour[c];
      to[3][s] = samples[k].alpha;
      to[4][s] = samples[k].depth;
    }
  });
  return result;
}

DeepImage inLayerColours(DeepImage image, const LayeredRows& rows, const LayerInputs& inputs) {
  const Pixels pixels(rows);
  const std::array<std::span<float>, 3> rgb = {image.get("R"), image.get("G"), image.get("B")};
  const std::span<const float> alpha = image.get("A");
  parallelFor(image.dataWindow.y0, image.dataWindow.y1, [&](int y) {
    const LayerRow row = layerRow(image, inputs, rows.scale, y);
    const Buffer<float> shares = rows.band.shares(y - rows.frame.y0, row.samples);
    const size_t first = image.dataWindow.index(image.dataWindow.x0, y);
    for (int x = 0; x < image.dataWindow.width(); ++x) {
      std::array<LayerPixel, nn::kMostLayers> layers{};
      for (int l = 0; l < pixels.layers(); ++l) layers[size_t(l)] = pixels.at(l, y, x);
      const std::array<float, 4> all = pixels.composited(y, x);
      const float whole = all[3] > kLeastAlpha ? 1 / all[3] : 0;
      for (uint64_t s = image.offsets[first + size_t(x)]; s < image.offsets[first + size_t(x) + 1]; ++s)
        for (size_t c = 0; c < 3 && alpha[s] > 0; ++c)
          rgb[c][s] = limited(double(std::min(alpha[s], 1.0f)) * double(all[c]) * double(whole));
      for (size_t i = row.samples.first[size_t(x)]; i < row.samples.first[size_t(x) + 1]; ++i) {
        std::array<float, 3> colour{};
        for (int l = 0; l < pixels.layers(); ++l) {
          const LayerPixel& layer = layers[size_t(l)];
          const float q = shares[size_t(l) * row.samples.count() + i];
          for (size_t c = 0; c < 3 && layer.alpha > kLeastAlpha; ++c) colour[c] += q * layer.colour[c] / layer.alpha;
        }
        const uint64_t s = row.places[i];
        for (size_t c = 0; c < 3; ++c) rgb[c][s] = limited(double(std::min(alpha[s], 1.0f)) * double(colour[c]));
      }
    }
  });
  std::erase_if(image.channels, [](const Channel& channel) {
    return channel.name.starts_with("diffuse.") || channel.name.starts_with("specular.") ||
           describesSamples(roleOf(channel));
  });
  return image;
}

}  // namespace fathom::deep
