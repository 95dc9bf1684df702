#include "deep/denoise_data.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "deep/alpha.h"

namespace fathom::deep {

namespace {

constexpr float kLeastCount = 1e-3f;
constexpr std::array<const char*, 3> kRgb{"R", "G", "B"};
constexpr std::array<const char*, 3> kXyz{"X", "Y", "Z"};
constexpr int kRowsAtOnce = 8;

// Calls body(bin) for all bins, rows in parallel.
template <class Body>
void forBins(const DenoiseData& data, const Body& body) {
  parallelRanges(0, data.height, kRowsAtOnce, [&](int y0, int y1) {
    const size_t end = size_t(data.offsets[size_t(y1) * size_t(data.width)]);
    for (size_t bin = size_t(data.offsets[size_t(y0) * size_t(data.width)]); bin < end; ++bin) body(bin);
  });
}

using Colour = std::array<std::span<const float>, 3>;

Colour colourOf(const DeepImage& image, const std::string& group, const std::array<const char*, 3>& names = kRgb) {
  return {image.get(group + names[0]), image.get(group + names[1]), image.get(group + names[2])};
}

// alpha^-1, or 0 where there is no alpha: such a sample has no say.
float unpremultiply(float alpha) {
  return alpha > 0 ? 1 / std::min(alpha, 1.0f) : 0;
}

// Of camera samples; what is far from one is none.
float countOf(float samples) {
  return samples >= kLeastCount && isFinite(samples) ? samples : 0;
}

void fillCounts(const DeepImage& image, const DenoiseInputs& inputs, DenoiseData& data) {
  data.weight = effectiveAlpha(image);
  for (float& weight : data.weight)
    if (weight < kLeastShare) weight = 0;
  data.count = Buffer<float>(data.bins());
  const std::span<const float> samples = inputs.counts ? image.get("samples") : std::span<const float>();
  const float spp = float(inputs.spp > 0 ? inputs.spp : kAssumedSpp);
  forBins(data, [&](size_t b) { data.count[b] = samples.empty() ? data.weight[b] * spp : countOf(samples[b]); });
}

// The same for the bins of pixels that are not skipped.
template <class Body>
void forBins(const DenoiseData& data, const Buffer<uint8_t>& skip, const Body& body) {
  parallelRanges(0, data.height, kRowsAtOnce, [&](int y0, int y1) {
    const size_t width = size_t(data.width);
    for (size_t pixel = size_t(y0) * width; pixel < size_t(y1) * width; ++pixel)
      for (size_t bin = size_t(data.offsets[pixel]); bin < size_t(data.offsets[pixel + 1]) && !skip[pixel]; ++bin)
        body(bin);
  });
}

Feature readFeature(const DeepImage& image, const std::string& group, const std::array<const char*, 3>& names,
                    bool variance, const Buffer<uint8_t>& skip, const DenoiseData& data) {
  Feature feature;
  const std::span<const float> alpha = image.get("A");
  for (const char* name : names) {
    const std::span<const float> in = image.get(group + name);
    const std::span<const float> var = variance ? image.get("variance." + group + name) : std::span<const float>();
    Buffer<float>& value = feature.value.emplace_back(data.bins());
    Buffer<float>& noise = feature.variance.emplace_back(data.bins());
    forBins(data, skip, [&](size_t b) {
      const float v = in[b] * unpremultiply(alpha[b]);
      value[b] = isFinite(v) ? v : 0;
      noise[b] = !var.empty() && var[b] > 0 && isFinite(var[b]) ? var[b] : 0;
    });
  }
  return feature;
}

// The logarithm makes depth a ratio: no unit, no overflow. A volume is its middle; its extent adds the variance of a
// uniform.
Feature readDepth(const DeepImage& image, const DenoiseInputs& inputs, const Buffer<uint8_t>& skip,
                  const DenoiseData& data) {
  Feature feature;
  const std::span<const float> z = image.get("Z");
  const std::span<const float> back = inputs.volumes ? image.get("ZBack") : std::span<const float>();
  const std::span<const float> var = inputs.depthVariance ? image.get("variance.Z") : std::span<const float>();
  Buffer<float>& value = feature.value.emplace_back(data.bins());
  Buffer<float>& noise = feature.variance.emplace_back(data.bins());
  forBins(data, skip, [&](size_t b) {
    const double front = std::isnan(z[b]) ? 1.0 : std::clamp(double(z[b]), 1e-30, 1e30);
    const double end = !back.empty() && back[b] > z[b] ? std::min(double(back[b]), 1e30) : front;
    const double middle = 0.5 * (front + end), extent = end - front;
    const double v = !var.empty() && var[b] > 0 && isFinite(var[b]) ? double(var[b]) : 0.0;
    value[b] = float(std::log(middle));
    noise[b] = float(std::min((v + extent * extent / 12) / (middle * middle), 1e6));
  });
  return feature;
}

// What each half says of its share of the bin: n_h / (spp / 2), from the counts where they are there.
std::array<float, 2> halfWeights(float weight, std::span<const float> n0, std::span<const float> n1, size_t b) {
  if (n0.empty()) return {weight, weight};
  const float a = countOf(n0[b]), c = countOf(n1[b]);
  if (!(a + c > 0)) return {0, 0};
  return {weight * 2 * a / (a + c), weight * 2 * c / (a + c)};
}

// Without halves there is only the variance of the whole colour: a component has the share of its part of the light,
// squared.
std::vector<Buffer<float>> componentVariance(const DeepImage& image, const DenoiseComponent& component,
                                             const DenoiseData& data) {
  std::vector<Buffer<float>> result;
  const Colour whole = colourOf(image, "");
  const std::span<const float> alpha = image.get("A");
  for (size_t c = 0; c < 3; ++c) {
    const std::span<const float> variance = image.get(std::string("variance.") + kRgb[c]);
    Buffer<float>& out = result.emplace_back(data.bins());
    forBins(data, [&](size_t b) {
      const float w = component.data[8 * b + 3];
      const float mean = w > 0 ? component.data[8 * b + c] / w : 0;
      float scale = 1;
      if (!component.name.empty()) {
        const float light = whole[c][b] * unpremultiply(alpha[b]);
        scale = light != 0 && isFinite(light) ? std::min(std::fabs(mean / light), 1e6f) : 0;
      }
      const float v = variance[b] * scale * scale;
      out[b] = v > 0 && isFinite(v) ? v : 0;
    });
  }
  return result;
}

void readComponent(const DeepImage& image, const DenoiseInputs& inputs, const std::string& name,
                   const Buffer<uint8_t>& nonFinite, DenoiseData& data) {
  DenoiseComponent component{name, name == "diffuse" && inputs.albedo, Buffer<float>(data.bins() * 8), {}};
  const std::string group = name.empty() ? "" : name + ".";
  const std::span<const float> alpha = image.get("A");
  const int blocks = data.halves ? 2 : 1;
  std::array<Colour, 2> colour, albedo;
  for (int h = 0; h < blocks; ++h) {
    const std::string half = data.halves ? fmt::format("half{}.", h) : "";
    colour[size_t(h)] = colourOf(image, half + group);
    if (component.perAlbedo) albedo[size_t(h)] = colourOf(image, (inputs.albedoHalves ? half : "") + "albedo.");
  }
  const std::span<const float> n0 = inputs.halfCounts ? image.get("half0.samples") : std::span<const float>();
  const std::span<const float> n1 = inputs.halfCounts ? image.get("half1.samples") : std::span<const float>();
  forBins(data, [&](size_t b) {
    const float inverse = nonFinite[b] ? 0 : unpremultiply(alpha[b]);
    const std::array<float, 2> weights =
        data.halves ? halfWeights(data.weight[b], n0, n1, b) : std::array{data.weight[b], 0.0f};
    float* out = component.data.data() + 8 * b;
    for (size_t h = 0; h < 2; ++h) {
      float w = inverse > 0 ? weights[h] : 0;
      std::array<float, 3> value{};
      for (size_t c = 0; c < 3 && w > 0; ++c) {
        float v = colour[h][c][b] * inverse;
        if (component.perAlbedo) {
          const float a = albedo[h][c][b] * inverse;  // what cannot be used counts as 0, as in readFeature
          v /= (a > 0 && isFinite(a) ? a : 0) + kAlbedoOffset;
        }
        value[c] = v;
      }
      if (!isFinite(value[0]) || !isFinite(value[1]) || !isFinite(value[2])) {
        value = {};
        w = 0;
      }
      for (size_t c = 0; c < 3; ++c) out[4 * h + c] = value[c] * w;
      out[4 * h + 3] = w;
    }
  });
  if (!data.halves && inputs.variance) component.variance = componentVariance(image, component, data);
  data.components.push_back(std::move(component));
}

// 1 for bins with a colour that is not finite, in whichever of the channels that tell it.
Buffer<uint8_t> findNonFinite(const DeepImage& image, const DenoiseInputs& inputs, const DenoiseData& data) {
  std::vector<std::string> groups{""};
  for (const char* component : {"diffuse.", "specular."})
    if (inputs.components) groups.push_back(component);
  std::vector<std::span<const float>> colours;
  for (const std::string& group : groups)
    for (const char* half : {"", "half0.", "half1."}) {
      const bool read = *half == 0 || (inputs.halves && inputs.components != group.empty());
      for (const char* rgb : kRgb)
        if (read) colours.push_back(image.get(half + group + rgb));
    }
  const std::span<const float> alpha = image.get("A");
  Buffer<uint8_t> result(data.bins(), 0);
  forBins(data, [&](size_t b) {
    const float scale = data.weight[b] > 0 ? unpremultiply(alpha[b]) : 1;
    for (const std::span<const float>& colour : colours) result[b] |= !isFinite(colour[b] * scale);
  });
  return result;
}

}  // namespace

DenoiseData prepareColours(const DeepImage& image, const DenoiseInputs& inputs) {
  DenoiseData data;
  data.width = image.dataWindow.width();
  data.height = image.dataWindow.height();
  data.rowPhase = image.dataWindow.y0;
  data.offsets = image.offsets.data();
  data.halves = inputs.halves;
  fillCounts(image, inputs, data);
  const Buffer<uint8_t> nonFinite = findNonFinite(image, inputs, data);
  data.nonFinite = uint64_t(std::count(nonFinite.begin(), nonFinite.end(), 1));
  if (inputs.components) {
    readComponent(image, inputs, "diffuse", nonFinite, data);
    readComponent(image, inputs, "specular", nonFinite, data);
  } else {
    readComponent(image, inputs, "", nonFinite, data);
  }
  return data;
}

void prepareFeatures(const DeepImage& image, const DenoiseInputs& inputs, const Buffer<uint8_t>& skip,
                     DenoiseData& data) {
  if (inputs.albedo) data.albedo = readFeature(image, "albedo.", kRgb, inputs.albedoVariance, skip, data);
  if (inputs.normal) data.normal = readFeature(image, "N.", kXyz, inputs.normalVariance, skip, data);
  data.depth = readDepth(image, inputs, skip, data);
}

}  // namespace fathom::deep
