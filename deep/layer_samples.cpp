#include "deep/layer_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/parallel.h"
#include "flat/finite.h"
#include "flat/neural_planes.h"
#include "nn/colour_kernel.h"

namespace fathom::deep {

namespace {

constexpr float kUnknownAlbedo = 0.5f;
constexpr float kCocUnit = 4;  // pixels
constexpr float kDark = 0.01f;
constexpr float kLargestDeviation = 8;
constexpr float kCountUnit = 8;        // doublings
constexpr float kMostExposed = 1e30f;  // beyond all light; sums of it are finite
constexpr double kAlone = 1e-6;        // a pixel of one sample, as far as its share tells

enum InputAt : size_t {
  kDiffuseAt = 0,
  kSpecularAt = 3,
  kAlbedoAt = 6,
  kNormalAt = 9,
  kDepthAt = 12,
  kCocAt = 13,
  kLensAt = 14,
  kNoiseAt = 17,
  kCountAt = 19
};

using Triple = std::array<std::span<const float>, 3>;

Triple tripleOf(const DeepImage& image, const std::string& prefix, const char* letters = "RGB") {
  Triple result;
  for (size_t c = 0; c < 3; ++c) result[c] = image.get(prefix + letters[c]);
  return result;
}

// The channels that the network takes its light from.
struct Light {
  Triple diffuse, specular;  // no diffuse: all light is specular

  Light(const DeepImage& image, const LayerInputs& inputs)
      : diffuse(inputs.components ? tripleOf(image, "diffuse.") : Triple()),
        specular(tripleOf(image, inputs.components ? "specular." : "")) {}

  float diffuseAt(size_t c, uint64_t s) const { return diffuse[c].empty() ? 0.0f : diffuse[c][s]; }
  float specularAt(size_t c, uint64_t s) const { return specular[c][s]; }
  float at(size_t c, uint64_t s) const { return diffuseAt(c, s) + specularAt(c, s); }

  bool finite(uint64_t s, float alpha) const {
    for (size_t c = 0; c < 3; ++c)
      if (!isFinite(diffuseAt(c, s) / alpha) || !isFinite(specularAt(c, s) / alpha)) return false;
    return true;
  }
};

// Calls used(place, weight, alpha) for the samples of a pixel that have a say, and emits(place, passed) for those without
// alpha and with finite values.
template <class Used, class Emits>
void forSamples(const DeepImage& image, const Light& light, std::span<const float> alphas,
                std::span<const float> depths, size_t pixel, const Used& used, const Emits& emits) {
  double passed = 1;
  for (uint64_t s = image.offsets[pixel]; s < image.offsets[pixel + 1]; ++s) {
    const float alpha = alphas[s] > 0 ? std::min(alphas[s], 1.0f) : 0.0f;
    const auto weight = float(passed * double(alpha));
    if (alpha <= 0 && light.finite(s, 1)) emits(s, float(passed));
    if (weight > 0 && isFinite(depths[s]) && light.finite(s, alpha)) used(s, weight, alpha);
    passed *= 1 - double(alpha);
  }
}

// The root of the mean of three variances; 0 where one is unknown.
float deviationAt(const Triple& variance, uint64_t s) {
  float sum = 0;
  for (const std::span<const float>& v : variance) {
    if (!std::isfinite(v[s])) return 0;
    sum += std::max(v[s], 0.0f) / 3;
  }
  return std::sqrt(sum);
}

// One row of inputs, plane by plane.
class RowMaker {
 public:
  RowMaker(const DeepImage& image, const LayerInputs& inputs, const LayerScale& scale, const Light& light,
           LayerRow& row)
      : image_(image), inputs_(inputs), scale_(scale), light_(light), places_(row.places), samples_(row.samples) {}

  void make(const std::vector<float>& weights, const std::vector<float>& alphas) {
    std::ranges::copy(weights, plane(nn::kWeightInput));
    addFeatures(alphas);
    addLight(alphas);
    addDepths();
    addNoise(weights, alphas);
    addCounts(weights);
    const size_t count = places_.size();
    nn::logColour(plane(kDiffuseAt), 6 * count, nn::Element::float32, reinterpret_cast<std::byte*>(plane(kDiffuseAt)));
    nn::logColour(plane(kNoiseAt), 3 * count, nn::Element::float32, reinterpret_cast<std::byte*>(plane(kNoiseAt)));
    for (size_t i = 0; i < count; ++i) plane(kCountAt)[i] *= std::numbers::log2e_v<float> / kCountUnit;
  }

 private:
  float* plane(size_t p) { return samples_.plane(p); }

  template <class Value>
  void fill(size_t p, const Value& value) {
    float* to = plane(p);
    for (size_t i = 0; i < places_.size(); ++i) to[i] = value(places_[i], i);
  }

  bool divided() const { return scale_.lights.front() == nn::SampleLight::Diffuse; }
  // What the diffuse light of a sample is divided by; after the features.
  float divisor(size_t c, size_t i) const {
    return divided() ? samples_.plane(kAlbedoAt + c)[i] + nn::kLeastAlbedo : 1.0f;
  }

  // As it is, and with a logarithm to be taken.
  void addLight(const std::vector<float>& alphas) {
    for (size_t c = 0; c < 3; ++c) {
      const auto exposed = [&](float value, size_t i) {
        return std::clamp(scale_.exposure * value / alphas[i], -kMostExposed, kMostExposed);
      };
      fill(nn::kExposedAt + c,
           [&](uint64_t s, size_t i) { return exposed(light_.diffuseAt(c, s) / divisor(c, i), i); });
      fill(nn::kExposedAt + 3 + c, [&](uint64_t s, size_t i) { return exposed(light_.specularAt(c, s), i); });
      fill(kDiffuseAt + c, [&](uint64_t, size_t i) { return std::max(plane(nn::kExposedAt + c)[i], 0.0f); });
      fill(kSpecularAt + c, [&](uint64_t, size_t i) { return std::max(plane(nn::kExposedAt + 3 + c)[i], 0.0f); });
    }
  }

  void addFeatures(const std::vector<float>& alphas) {
    const auto add = [&](bool given, size_t first, const std::string& prefix, const char* letters, float least,
                         float none) {
      const Triple values = given ? tripleOf(image_, prefix, letters) : Triple();
      for (size_t c = 0; c < 3; ++c)
        fill(first + c, [&](uint64_t s, size_t i) {
          return given ? std::clamp(finiteOrZero(values[c][s] / alphas[i]), least, 1.0f) : none;
        });
    };
    add(inputs_.albedo, kAlbedoAt, "albedo.", "RGB", 0, kUnknownAlbedo);
    add(inputs_.normal, kNormalAt, "N.", "XYZ", -1, 0);
  }

  void addDepths() {
    const std::span<const float> z = image_.get("Z");
    fill(nn::kSampleDepth, [&](uint64_t s, size_t) { return z[s]; });
    fill(kDepthAt, [&](uint64_t s, size_t) { return z[s] > 0 ? z[s] / (z[s] + scale_.depth) : 0.0f; });
    const std::span<const float> coc = inputs_.coc ? image_.get("coc") : std::span<const float>();
    fill(kCocAt, [&](uint64_t s, size_t) {
      const float c = coc.empty() ? 0.0f : finiteOrZero(coc[s]);
      return c / (std::abs(c) + kCocUnit);
    });
    for (size_t k = 0; k < 2; ++k) {
      const std::span<const float> lens = inputs_.lens ? image_.get(k ? "lens.V" : "lens.U") : std::span<const float>();
      fill(kLensAt + k,
           [&](uint64_t s, size_t) { return lens.empty() ? 0.0f : std::clamp(finiteOrZero(lens[s]), -1.0f, 1.0f); });
    }
  }

  // After the light, before its logarithm.
  void addNoise(const std::vector<float>& weights, const std::vector<float>& alphas) {
    for (size_t k = 0; k < 2; ++k) {
      const std::vector<float> deviations = deviationsOf(k, weights, alphas);
      const float* light = plane(k ? kSpecularAt : kDiffuseAt);
      const size_t count = places_.size();
      fill(kNoiseAt + k, [&](uint64_t, size_t i) {
        const float mean = light[i] / 3 + light[count + i] / 3 + light[2 * count + i] / 3;
        const float by = k ? 1.0f : (divisor(0, i) + divisor(1, i) + divisor(2, i)) / 3;
        return std::min(scale_.exposure * deviations[i] / (by * (mean + kDark)), kLargestDeviation);
      });
    }
  }

  // Of the means of diffuse (k = 0) or specular light.
  std::vector<float> deviationsOf(size_t k, const std::vector<float>& weights, const std::vector<float>& alphas) const {
    std::vector<float> result(places_.size(), 0.0f);
    if (inputs_.cameraSamples()) {
      for (size_t x = 0; x + 1 < samples_.first.size(); ++x) {
        const size_t from = samples_.first[x], to = samples_.first[x + 1];
        std::fill(result.begin() + ptrdiff_t(from), result.begin() + ptrdiff_t(to),
                  pixelDeviation(k, from, to, weights, alphas));
      }
    } else if (k ? inputs_.specularVariance || inputs_.variance : inputs_.diffuseVariance) {
      const Triple variance = tripleOf(image_, k == 0                     ? "variance.diffuse."
                                               : inputs_.specularVariance ? "variance.specular."
                                                                          : "variance.");
      for (size_t i = 0; i < result.size(); ++i) result[i] = deviationAt(variance, places_[i]);
    }
    return result;
  }

  // The root of the mean variance of what the samples [from, to) of a pixel have on average; 0 for a single one.
  float pixelDeviation(size_t k, size_t from, size_t to, const std::vector<float>& weights,
                       const std::vector<float>& alphas) const {
    const auto at = [&](size_t c, size_t i) {
      return double((k ? light_.specularAt(c, places_[i]) : light_.diffuseAt(c, places_[i])) / alphas[i]);
    };
    double whole = 0, independent = 1, squares = 0;
    for (size_t i = from; i < to; ++i) whole += double(weights[i]);
    const auto share = [&](size_t i) { return double(weights[i]) / whole; };
    for (size_t i = from; i < to; ++i) independent -= share(i) * share(i);  // n equal ones: 1 - 1 / n
    if (independent <= kAlone) return 0;
    for (size_t c = 0; c < 3; ++c) {
      double mean = 0;
      for (size_t i = from; i < to; ++i) mean += share(i) * at(c, i);
      for (size_t i = from; i < to; ++i) squares += std::pow(share(i) * (at(c, i) - mean), 2) / 3;
    }
    return float(std::sqrt(squares / independent));
  }

  void addCounts(const std::vector<float>& weights) {
    const std::span<const float> counts = inputs_.counts ? image_.get("samples") : std::span<const float>();
    fill(kCountAt, [&](uint64_t s, size_t i) {
      if (!counts.empty()) return std::max(finiteOrZero(counts[s]), 0.0f);
      return inputs_.spp > 0 ? weights[i] * float(inputs_.spp) : 1.0f;
    });
  }

  const DeepImage& image_;
  const LayerInputs& inputs_;
  const LayerScale& scale_;
  const Light& light_;
  const std::vector<uint64_t>& places_;
  nn::SampleRow& samples_;
};

}  // namespace

LayerScaleSum::LayerScaleSum(const Box& dataWindow) : dataWindow_(dataWindow), light_(3 * dataWindow.area(), 0.0f) {}

void LayerScaleSum::add(const DeepImage& rows, const LayerInputs& inputs) {
  const Light light(rows, inputs);
  const std::span<const float> alpha = rows.get("A"), z = rows.get("Z");
  const int height = rows.dataWindow.height(), width = rows.dataWindow.width();
  const size_t first = size_t(rows.dataWindow.y0 - dataWindow_.y0) * size_t(width), plane = dataWindow_.area();
  std::vector<double> depth(static_cast<size_t>(height), 0), weight(static_cast<size_t>(height), 0);
  std::vector<std::array<bool, 2>> lit(static_cast<size_t>(height));  // by diffuse and by specular light
  parallelFor(0, height, [&](int y) {
    for (size_t pixel = size_t(y) * size_t(width); pixel < size_t(y + 1) * size_t(width); ++pixel) {
      std::array<double, 3> sum{};
      forSamples(
          rows, light, alpha, z, pixel,
          [&](uint64_t s, float w, float a) {
            for (size_t c = 0; c < 3; ++c) {
              sum[c] += double(w) * double(light.at(c, s) / a);
              lit[size_t(y)][0] |= light.diffuseAt(c, s) != 0;
              lit[size_t(y)][1] |= light.specularAt(c, s) != 0;
            }
            depth[size_t(y)] += double(w) * double(z[s]);
            weight[size_t(y)] += double(w);
          },
          [](uint64_t, float) {});
      for (size_t c = 0; c < 3; ++c) light_[c * plane + first + pixel] = float(sum[c]);
    }
  });
  for (size_t y = 0; y < depth.size(); ++y) depth_ += depth[y], weight_ += weight[y];
  for (const auto& [diffuse, specular] : lit) diffuse_ |= diffuse, specular_ |= specular;
}

LayerScale LayerScaleSum::result() const {
  flat::Image frame{dataWindow_, dataWindow_, {}, {}};
  for (size_t c = 0; c < 3; ++c)
    std::copy_n(light_.data() + c * dataWindow_.area(), dataWindow_.area(),
                frame.add(std::string(1, "RGB"[c])).values.data());
  const double mean = weight_ > 0 ? depth_ / weight_ : 1;
  LayerScale scale{flat::exposureOf(frame), mean > 0 ? float(mean) : 1.0f};
  if (diffuse_) scale.lights = {nn::SampleLight::Diffuse};
  if (diffuse_ && specular_) scale.lights.push_back(nn::SampleLight::Specular);
  return scale;
}

LayerRow layerRow(const DeepImage& rows, const LayerInputs& inputs, const LayerScale& scale, int y) {
  const Light light(rows, inputs);
  const std::span<const float> alpha = rows.get("A"), z = rows.get("Z");
  const auto width = size_t(rows.dataWindow.width());
  LayerRow row;
  row.emission = Buffer<float>(3 * width, 0.0f);
  row.emissionDepth = Buffer<float>(width, 0.0f);
  row.render = Buffer<float>(width, 0.0f);
  row.nonFinite.resize(width);
  row.samples.first.push_back(0);
  std::vector<float> weights, alphas;
  const size_t first = size_t(y - rows.dataWindow.y0) * width;
  for (size_t x = 0; x < width; ++x) {
    double bright = 0;
    forSamples(
        rows, light, alpha, z, first + x,
        [&](uint64_t s, float w, float a) {
          for (size_t c = 0; c < 3; ++c) bright += double(w) * double(light.at(c, s) / a) / 3;
          row.places.push_back(s);
          weights.push_back(w);
          alphas.push_back(a);
        },
        [&](uint64_t s, float passed) {
          for (size_t c = 0; c < 3; ++c) row.emission[c * width + x] += passed * light.at(c, s);
          if (row.emissionDepth[x] == 0 && isFinite(z[s])) row.emissionDepth[x] = z[s];
        });
    row.samples.first.push_back(uint32_t(row.places.size()));
    row.render[x] = float(bright);
    for (uint64_t s = rows.offsets[first + x]; s < rows.offsets[first + x + 1]; ++s)
      row.nonFinite[x] += alpha[s] > 0 && (!isFinite(z[s]) || !light.finite(s, std::min(alpha[s], 1.0f)));
  }
  row.samples.values = Buffer<float>(nn::kSamplePlanes * row.places.size());
  RowMaker(rows, inputs, scale, light, row).make(weights, alphas);
  return row;
}

}  // namespace fathom::deep
