#include "flat/neural_planes.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "flat/finite.h"
#include "flat/level.h"
#include "nn/colour_kernel.h"

namespace fathom::flat {

namespace {

constexpr float kKey = 0.2f;  // the geometric mean of exposed blocks
constexpr int kBlock = 8;
constexpr double kTinyBlock = 1e-3;
constexpr float kDark = 0.01f;  // keeps relative deviations of dark pixels small
constexpr float kLargestDeviation = 8;
constexpr float kHalvesPerDeviation = 1.6f;  // |half0 - half1| of a deviation of 1 of the mean
constexpr float kMostExposed = 1e30f;        // beyond all light; its square root and logarithm are finite

enum PlaneAt : size_t {
  kColourAt = 0,
  kAlbedoAt = 3,
  kNormalAt = 6,
  kDepthAt = 9,
  kAlphaAt = 10,
  kNoiseAt = 11,
  kAlbedoNoiseAt = 12,
  kNormalNoiseAt = 13,
  kDepthNoiseAt = 14,
  kHalvesAt = 15,
  kRestAt = 16,
  kGivenAt = 19,
  kKindAt = 23
};

// Planes of logarithms that a light has of its own.
constexpr std::array<size_t, 8> kLogarithms = {kColourAt, kColourAt + 1, kColourAt + 2, kNoiseAt,
                                               kHalvesAt, kRestAt,       kRestAt + 1,   kRestAt + 2};

int rounded(int side) {
  constexpr int kStep = nn::CompositionalNet::kAlignment;
  return (side + kStep - 1) / kStep * kStep;
}

// Three channels, all of them or none.
class Triple {
 public:
  Triple(const Image& image, const std::string& prefix, const char* letters = "RGB") {
    for (size_t c = 0; c < 3; ++c) planes_[c] = image.find(prefix + letters[c]);
    if (!planes_[0] || !planes_[1] || !planes_[2]) planes_ = {};
  }
  bool given() const { return planes_[0]; }
  float at(size_t c, size_t i) const { return finiteOrZero(planes_[c]->values[i]); }

 private:
  std::array<const Plane*, 3> planes_{};
};

// A light of a half buffer: of its own, or for the whole the sum of its components.
class HalfLight {
 public:
  HalfLight(const Image& image, const std::string& half, Light light)
      : own_(image, half + prefixOf(light)),
        diffuse_(image, half + prefixOf(Light::Diffuse)),
        specular_(image, half + prefixOf(Light::Specular)),
        sum_(light == Light::Whole && !own_.given() && diffuse_.given() && specular_.given()) {}
  bool given() const { return own_.given() || sum_; }
  float at(size_t c, size_t i) const { return sum_ ? diffuse_.at(c, i) + specular_.at(c, i) : own_.at(c, i); }

 private:
  Triple own_, diffuse_, specular_;
  bool sum_;
};

float varianceAt(const Plane& plane, size_t i) {
  const float v = plane.values[i];
  return v > 0 && v <= kMostExposed ? v : 0.0f;
}

// The variances of three channels, all of them or none.
struct Variances {
  std::array<const Plane*, 3> planes{};

  Variances(const Image& image, const std::string& prefix, const char* letters = "RGB") {
    for (size_t c = 0; c < 3; ++c) planes[c] = image.find("variance." + prefix + letters[c]);
    if (!planes[0] || !planes[1] || !planes[2]) planes = {};
  }
  bool given() const { return planes[0]; }
  // The root of the mean variance.
  float deviation(size_t i) const {
    float sum = 0;
    for (const Plane* plane : planes) sum += varianceAt(*plane, i) / 3;
    return std::sqrt(sum);
  }
  float meanDeviation(size_t i) const {
    float sum = 0;
    for (const Plane* plane : planes) sum += std::sqrt(varianceAt(*plane, i)) / 3;
    return sum;
  }
};

Variances variancesOf(const Image& image, Light light) {
  const Variances own(image, prefixOf(light));
  return own.given() ? own : Variances(image, "");
}

float meanDepth(const Plane& plane) {
  LevelSum depths;
  for (const float value : plane.values)
    if (value > 0) depths.add(double(value));
  const auto mean = float(depths.mean(kAbsurd));
  return mean > 0 ? mean : 1.0f;
}

}  // namespace

std::string prefixOf(Light light) {
  return light == Light::Diffuse ? "diffuse." : light == Light::Specular ? "specular." : "";
}

bool hasLight(const Image& image, Light light) {
  return Triple(image, prefixOf(light)).given();
}

float exposureOf(const Image& image) {
  const Triple rgb(image, "");
  const int width = image.dataWindow.width(), height = image.dataWindow.height();
  const int across = (width + kBlock - 1) / kBlock, down = (height + kBlock - 1) / kBlock;
  std::vector<double> means(size_t(across) * size_t(down));
  parallelFor(0, down, [&](int by) {
    for (int bx = 0; bx < across; ++bx) {
      const int x1 = std::min((bx + 1) * kBlock, width), y1 = std::min((by + 1) * kBlock, height);
      double sum = 0;
      for (int y = by * kBlock; y < y1; ++y)
        for (int x = bx * kBlock; x < x1; ++x) {
          const size_t i = size_t(y) * size_t(width) + size_t(x);
          sum += (double(rgb.at(0, i)) + double(rgb.at(1, i)) + double(rgb.at(2, i))) / 3;
        }
      means[size_t(by) * size_t(across) + size_t(bx)] = sum / ((x1 - bx * kBlock) * (y1 - by * kBlock));
    }
  });
  std::erase_if(means, [](double mean) { return !(mean > 0); });
  if (means.empty()) return 1;
  LevelSum all;
  for (const double mean : means) all.add(mean);
  const double least = kTinyBlock * all.mean(kAbsurd);
  double logarithms = 0;
  for (const double mean : means) logarithms += std::log(std::max(mean, least));
  return float(std::min(double(kKey) / std::exp(logarithms / double(means.size())), double(kMostExposed)));
}

NeuralPlanes::NeuralPlanes(const Image& image)
    : image_(image), height_(rounded(image.dataWindow.height())), width_(rounded(image.dataWindow.width())) {
  for (const char* name : {"R", "G", "B"}) image.get(name);
  exposure_ = exposureOf(image);
  const size_t pixels = size_t(height_) * size_t(width_);
  planes_ = Buffer<float>(nn::kInputPlanes * pixels);
  colour_ = Buffer<float>(3 * pixels);
  fillFeatures();
}

// The planes that are the same for every light.
void NeuralPlanes::fillFeatures() {
  const Triple albedo(image_, "albedo."), normal(image_, "N.", "XYZ");
  const Variances albedoNoise(image_, "albedo."), normalNoise(image_, "N.", "XYZ");
  const Plane *depth = image_.find("Z"), *depthNoise = image_.find("variance.Z"), *alpha = image_.find("A");
  const float middle = depth ? meanDepth(*depth) : 1.0f;
  const int width = image_.dataWindow.width();
  parallelFor(0, image_.dataWindow.height(), [&](int y) {
    for (int x = 0; x < width; ++x) {
      const size_t i = size_t(y) * size_t(width) + size_t(x);
      for (size_t c = 0; c < 3; ++c) {
        row(kAlbedoAt + c, y)[x] = albedo.given() ? std::clamp(albedo.at(c, i), 0.0f, 1.0f) : 0.0f;
        row(kNormalAt + c, y)[x] = normal.given() ? std::clamp(normal.at(c, i), -1.0f, 1.0f) : 0.0f;
      }
      const float z = depth ? std::max(finiteOrZero(depth->values[i]), 0.0f) : 0.0f;
      row(kDepthAt, y)[x] = z / (z + middle);
      row(kAlphaAt, y)[x] = alpha ? finiteOrZero(alpha->values[i]) : 1.0f;
      row(kAlbedoNoiseAt, y)[x] =
          albedo.given() && albedoNoise.given() ? std::min(albedoNoise.deviation(i), 1.0f) : 0.0f;
      row(kNormalNoiseAt, y)[x] =
          normal.given() && normalNoise.given() ? std::min(normalNoise.deviation(i), 1.0f) : 0.0f;
      row(kDepthNoiseAt, y)[x] = z > 0 && depthNoise ? std::min(std::sqrt(varianceAt(*depthNoise, i)) / z, 1.0f) : 0.0f;
    }
  });
  fillRest(planes_.data() + kAlbedoAt * size_t(height_) * size_t(width_), kNoiseAt - kAlbedoAt);
  fillRest(planes_.data() + kAlbedoNoiseAt * size_t(height_) * size_t(width_), kHalvesAt - kAlbedoNoiseAt);
  fillConstant(kGivenAt, albedo.given() ? 1.0f : 0.0f);
  fillConstant(kGivenAt + 1, normal.given() ? 1.0f : 0.0f);
  fillConstant(kGivenAt + 2, depth ? 1.0f : 0.0f);
}

float NeuralPlanes::divisor(size_t c, int y, int x) const {
  const size_t i = ((kAlbedoAt + c) * size_t(height_) + size_t(y)) * size_t(width_) + size_t(x);
  return divided_ ? planes_[i] + kLeastAlbedo : 1.0f;
}

void NeuralPlanes::select(Light light) {
  const Triple rgb(image_, ""), own(image_, prefixOf(light));
  if (!own.given()) fail("channel {}R: expected in the image, found none", prefixOf(light));
  const Variances variances = variancesOf(image_, light);
  const HalfLight first(image_, "half0.", light), second(image_, "half1.", light);
  const bool halves = first.given() && second.given();
  divided_ = light == Light::Diffuse && Triple(image_, "albedo.").given();
  const float s = exposure_;
  const int width = image_.dataWindow.width();
  parallelFor(0, image_.dataWindow.height(), [&](int y) {
    for (int x = 0; x < width; ++x) {
      const size_t i = size_t(y) * size_t(width) + size_t(x);
      float mean = 0, apart = 0, meanDivisor = 0;
      for (size_t c = 0; c < 3; ++c) {
        const float value = own.at(c, i), by = divisor(c, y, x);
        const float exposed = std::clamp(s * value / by, 0.0f, kMostExposed);
        colourRow(c, y)[x] = exposed;
        row(kColourAt + c, y)[x] = exposed;
        const float rest = light == Light::Whole ? 0.0f : std::max(rgb.at(c, i) - value, 0.0f);
        row(kRestAt + c, y)[x] = std::min(s * rest, kMostExposed);
        mean += exposed / 3;
        meanDivisor += by / 3;
        if (halves) apart += std::abs(first.at(c, i) - second.at(c, i)) / 3;
      }
      const auto relative = [&](float deviation) {
        return std::min(deviation * s / ((mean + kDark) * meanDivisor), kLargestDeviation);
      };
      if (!halves && variances.given()) apart = kHalvesPerDeviation * variances.meanDeviation(i);
      row(kNoiseAt, y)[x] = variances.given() ? relative(variances.deviation(i)) : 0.0f;
      row(kHalvesAt, y)[x] = relative(apart);
    }
    for (const size_t plane : kLogarithms)
      nn::logColour(row(plane, y), size_t(width), nn::Element::float32, reinterpret_cast<std::byte*>(row(plane, y)));
  });
  const size_t pixels = size_t(height_) * size_t(width_);
  fillRest(colour_.data(), 3);
  fillRest(planes_.data(), kAlbedoAt);
  fillRest(planes_.data() + kNoiseAt * pixels, 1);
  fillRest(planes_.data() + kHalvesAt * pixels, kGivenAt - kHalvesAt);
  fillConstant(kGivenAt + 3, variances.given() ? 1.0f : 0.0f);
  fillConstant(kKindAt, light == Light::Diffuse ? 1.0f : light == Light::Specular ? -1.0f : 0.0f);
}

void NeuralPlanes::fillConstant(size_t plane, float value) {
  std::fill_n(row(plane, 0), size_t(height_) * size_t(width_), value);
}

// Repeats the last column and row of planes into what fills the sides up.
void NeuralPlanes::fillRest(float* first, size_t planes) const {
  const int width = image_.dataWindow.width(), height = image_.dataWindow.height();
  const size_t stride = size_t(width_);
  if (width == 0) return;
  for (size_t p = 0; p < planes; ++p) {
    float* plane = first + p * size_t(height_) * stride;
    for (int y = 0; y < height; ++y) {
      float* values = plane + size_t(y) * stride;
      std::fill(values + width, values + width_, values[width - 1]);
    }
    for (int y = height; y < height_; ++y)
      std::copy_n(plane + size_t(height - 1) * stride, stride, plane + size_t(y) * stride);
  }
}

nn::CompositionalInput NeuralPlanes::input() const {
  return {nn::denseRows<const float>(planes_.data(), nn::kInputPlanes, height_, width_),
          nn::denseRows<const float>(colour_.data(), 3, height_, width_), height_, width_};
}

}  // namespace fathom::flat
