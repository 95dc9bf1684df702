#include "flat/mix_planes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "flat/finite.h"
#include "flat/level.h"
#include "flat/neural_planes.h"

namespace fathom::flat {

namespace {

constexpr float kDark = 0.01f, kLeast = 1e-6f, kFloor = 1e-4f, kLargestResidual = 4;
constexpr double kMostExposed = 1e15;

using Triple = std::array<const float*, 3>;  // null: not there

// All three planes or none.
Triple find(const Image& image, const std::string& prefix, const char* letters = "RGB") {
  Triple result{};
  for (size_t c = 0; c < 3; ++c)
    if (const Plane* plane = image.find(prefix + letters[c])) result[c] = plane->values.data();
  if (!result[0] || !result[1] || !result[2]) result = {};
  return result;
}

float logarithm(float relative) {
  return (std::log(relative + kLeast) + 5) / 3;
}

template <class Number>
Number square(Number x) {
  return x * x;
}

// Exposed and within bounds; the square of a dark frame's scale is no float.
float exposed(float value, double scale) {
  return float(std::clamp(double(finiteOrZero(value)) * scale, -kMostExposed, kMostExposed));
}

double meanDepth(const Plane* plane) {
  LevelSum depths;
  for (size_t i = 0; plane && i < plane->values.size(); ++i)
    if (plane->values[i] > 0) depths.add(double(plane->values[i]));
  const double mean = depths.mean(kAbsurd);
  return mean > 0 ? mean : 1;
}

class Source {
 public:
  Source(const Image& noisy, const Noise& noise, std::span<const Candidate> candidates)
      : noise_(noise),
        candidates_(candidates),
        width_(noisy.dataWindow.width()),
        height_(noisy.dataWindow.height()),
        scale_(double(exposureOf(noisy))),
        x_(find(noisy, "")),
        albedo_(find(noisy, "albedo.")),
        normal_(find(noisy, "N.", "XYZ")),
        depth_(noisy.find("Z")),
        meanDepth_(float(meanDepth(depth_))) {
    for (const Candidate& candidate : candidates) {
      y_.push_back(find(candidate.denoised, ""));
      LevelSum errors;
      for (size_t i = 0; i < candidate.k.size(); ++i)
        errors.add(double(relative(candidate.map.error, i, levelOf(y_.back(), i))));
      frame_.push_back(logarithm(float(errors.mean(kAbsurd))));
    }
  }

  void fillShared(const nn::Window& window, const nn::Planes& to) const {
    forPixels(window, [&](size_t i, int row, int column) {
      const auto put = [&](size_t plane, float value) { to.row(plane, row)[column] = value; };
      float sum = 0, variance = 0;
      for (size_t c = 0; c < 3; ++c) {
        const float x = std::max(exposed(x_[c][i], scale_), 0.0f);
        sum += x;
        variance += exposed(noise_.variance[c][i], square(scale_));
        put(c, std::log1p(x));
        put(3 + c, albedo_[c] ? std::clamp(finiteOrZero(albedo_[c][i]), 0.0f, 1.0f) : 0);
        put(6 + c, normal_[c] ? std::clamp(finiteOrZero(normal_[c][i]), -1.0f, 1.0f) : 0);
      }
      const float z = depth_ ? std::max(finiteOrZero(depth_->values[i]), 0.0f) : 0;
      put(9, z / (z + meanDepth_));
      put(10, logarithm(variance / 3 / (square(sum / 3) + kDark)));
      put(11, std::log2(noise_.samples[i]) / 4 - 1);
    });
  }

  void fillOwn(size_t n, const nn::Window& window, const nn::Planes& to) const {
    const Candidate& candidate = candidates_[n];
    forPixels(window, [&](size_t i, int row, int column) {
      const auto put = [&](size_t plane, float value) { to.row(plane, row)[column] = value; };
      const float level = levelOf(y_[n], i);
      float residual = 0, own = 0, variance = 0, covariance = 0;
      for (size_t c = 0; c < 3; ++c) {
        const float y = std::max(exposed(y_[n][c][i], scale_), 0.0f);
        put(c, std::log1p(y));
        residual += y - exposed(x_[c][i], scale_);
        own += exposed(noise_.variance[c][i], square(scale_));
        variance += exposed(candidate.map.variance[c][i], square(scale_));
        covariance += exposed(candidate.map.covariance[c][i], square(scale_));
      }
      put(3, logarithm(relative(candidate.map.error, i, level)));
      put(4, logarithm(relative(candidate.spread, i, level)));
      put(5, logarithm(relative(candidate.map.variance, i, level)));
      put(6, covariance / (variance + kLeast * level));
      put(7, std::clamp(residual / std::sqrt(own + kFloor * level), -kLargestResidual, kLargestResidual));
      put(8, candidate.k[i]);
      put(9, frame_[n]);
    });
  }

 private:
  float levelOf(const Triple& y, size_t i) const {
    float sum = 0;
    for (size_t c = 0; c < 3; ++c) sum += std::max(exposed(y[c][i], scale_), 0.0f);
    return square(sum / 3) + kDark;
  }

  float relative(const std::array<Buffer<float>, 3>& planes, size_t i, float level) const {
    float sum = 0;
    for (size_t c = 0; c < 3; ++c) sum += std::max(exposed(planes[c][i], square(scale_)), 0.0f);
    return sum / 3 / level;
  }

  // Beyond the edges stand the last pixels.
  template <class Body>
  void forPixels(const nn::Window& window, const Body& body) const {
    for (int y = 0; y < window.height; ++y)
      for (int x = 0; x < window.width; ++x)
        body(size_t(std::min(window.y + y, height_ - 1)) * size_t(width_) + size_t(std::min(window.x + x, width_ - 1)),
             y, x);
  }

  const Noise& noise_;
  const std::span<const Candidate> candidates_;
  const int width_, height_;
  const double scale_;
  const Triple x_, albedo_, normal_;
  const Plane* depth_;
  const float meanDepth_;
  std::vector<Triple> y_;
  std::vector<float> frame_;
};

}  // namespace

nn::MixSource mixSource(const Image& noisy, const Noise& noise, std::span<const Candidate> candidates) {
  const auto source = std::make_shared<Source>(noisy, noise, candidates);
  return {.candidates = int(candidates.size()),
          .height = noisy.dataWindow.height(),
          .width = noisy.dataWindow.width(),
          .shared = [source](const nn::Window& window, const nn::Planes& to) { source->fillShared(window, to); },
          .own = [source](int n, const nn::Window& window,
                          const nn::Planes& to) { source->fillOwn(size_t(n), window, to); }};
}

}  // namespace fathom::flat
