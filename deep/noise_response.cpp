#include "deep/noise_response.h"

#include <algorithm>
#include <string>
#include <vector>

#include "base/parallel.h"

namespace fathom::deep {

namespace {

constexpr int kPoolRadius = 2;

bool dividesByAlbedo(const DenoiseInputs& inputs) {
  return inputs.components && inputs.albedo;
}

// Half 0 less half 1 of the sum of some channels.
Buffer<float> difference(const DeepImage& image, std::span<const std::string> channels) {
  Buffer<float> result(image.pixels(), 0.0f);
  for (const std::string& name : channels) {
    const std::span<const float> a = image.get("half0." + name), b = image.get("half1." + name);
    for (size_t i = 0; i < result.size(); ++i) result[i] += a[i] - b[i];
  }
  return result;
}

// The halves' parts of a pixel's samples.
std::array<float, 2> partsOf(const float* v) {
  const float all = v[3] + v[7];
  return all > 0 ? std::array{v[3] / all, v[7] / all} : std::array{0.5f, 0.5f};
}

// What adds up to the light of a channel, as far as noise goes: components, and the albedo of the first that has one.
// For each, and last for the light itself, a plane of covariances with the light, pooled.
class Parts {
 public:
  Parts(const FilterResult& result, size_t c) : r_(result), planes_(result.answers.size() + 2) {
    for (Buffer<float>& plane : planes_) plane = Buffer<float>(r_.still.size(), 0.0f);
    const size_t width = size_t(r_.data.width);
    parallelFor(0, r_.data.height, [&](int y) {
      for (size_t i = size_t(y) * width; i < size_t(y + 1) * width; ++i)
        if (!r_.still[i]) addProducts(c, i);
    });
    for (Buffer<float>& plane : planes_) plane = pooled(plane);
  }

  // Of the k-th component, or the albedo where k is their number.
  float of(size_t k, size_t i) const {
    const float all = planes_.back()[i];
    return all > 0 ? std::clamp(planes_[k][i] / all, -1.0f, 1.0f) : 0;
  }

 private:
  void addProducts(size_t c, size_t i) {
    const float d = r_.differences.light[c][i];
    for (size_t k = 0; k < r_.answers.size(); ++k) {
      const DenoiseComponent& component = r_.data.components[k];
      const float* v = component.data.data() + 8 * i;
      if (!(v[3] > 0) || !(v[7] > 0)) continue;
      const float scale = component.perAlbedo ? r_.data.albedo.value[c][i] + kAlbedoOffset : 1;
      planes_[k][i] = scale * (v[c] / v[3] - v[4 + c] / v[7]) * d;
      if (component.perAlbedo)
        planes_[r_.answers.size()][i] = r_.filtered[k][3 * i + c] / scale * r_.differences.albedo[c][i] * d;
    }
    planes_.back()[i] = d * d;
  }

  // Sums over 5x5 pixels.
  Buffer<float> pooled(const Buffer<float>& plane) const {
    const int width = r_.data.width, height = r_.data.height;
    Buffer<float> result(plane.size());
    parallelFor(0, height, [&](int y) {
      for (int x = 0; x < width; ++x) {
        float sum = 0;
        for (int yq = std::max(0, y - kPoolRadius); yq <= std::min(height - 1, y + kPoolRadius); ++yq)
          for (int xq = std::max(0, x - kPoolRadius); xq <= std::min(width - 1, x + kPoolRadius); ++xq)
            sum += finiteOrZero(plane[size_t(yq) * size_t(width) + size_t(xq)]);
        result[size_t(y) * size_t(width) + size_t(x)] = sum;
      }
    });
    return result;
  }

  const FilterResult& r_;
  std::vector<Buffer<float>> planes_;
};

// The sum over halves of Cov(F_h, c_h), by the variance of y.
float ownCovariance(const FilterResult& r, const Parts& parts, size_t i) {
  const std::array<float, 2> samples = partsOf(r.data.components.front().data.data() + 8 * i);
  float sum = 0;
  for (size_t h = 0; h < 2; ++h) {
    if (!(samples[h] > 0)) continue;
    for (size_t k = 0; k < r.answers.size(); ++k) sum += parts.of(k, i) * r.answers[k].share[h][i] / samples[h];
  }
  // The albedo is that of all samples: its covariance with either half is that with y.
  if (!r.data.albedo.own.empty()) sum += 2 * parts.of(r.answers.size(), i) * r.data.albedo.own[i];
  return std::max(sum, 0.0f);
}

// F_0 - F_1 in one channel.
float filteredDifference(const FilterResult& r, size_t c, size_t i) {
  float sum = 0;
  for (size_t k = 0; k < r.answers.size(); ++k)
    sum += (r.data.components[k].perAlbedo ? r.data.albedo.value[c][i] + kAlbedoOffset : 1) *
           r.answers[k].difference[c][i];
  return sum;
}

// The variance of y as flat/noise has it.
Buffer<float> varianceOf(const FilterResult& r, size_t c) {
  Buffer<float> result(r.still.size());
  const std::span<const float> file =
      r.inputs.variance ? r.image.get(std::string("variance.") + flat::kRgbNames[c]) : std::span<const float>();
  for (size_t i = 0; i < result.size(); ++i) {
    const auto [p0, p1] = partsOf(r.data.components.front().data.data() + 8 * i);
    const float d = r.differences.light[c][i];
    result[i] = file.empty() ? p0 * p1 * d * d : std::max(finiteOrZero(file[i]), 0.0f);
  }
  return result;
}

}  // namespace

bool tellsResponse(const DenoisePlan& plan) {
  return plan.inputs.halves && (!dividesByAlbedo(plan.inputs) || plan.inputs.albedoHalves);
}

HalfDifferences halfDifferences(const DeepImage& image, const DenoiseInputs& inputs, const DenoiseData& data) {
  HalfDifferences result;
  for (size_t c = 0; c < 3; ++c) {
    const std::string name = flat::kRgbNames[c];
    result.light[c] =
        difference(image, inputs.components ? std::vector{"diffuse." + name, "specular." + name} : std::vector{name});
    if (dividesByAlbedo(inputs)) result.albedo[c] = difference(image, std::vector{"albedo." + name});
  }
  for (size_t i = 0; i < image.pixels(); ++i) {
    const float* v = data.components.front().data.data() + 8 * i;
    for (auto* planes : {&result.light, &result.albedo})
      for (Buffer<float>& plane : *planes)
        if (!plane.empty() && (!(v[3] > 0) || !(v[7] > 0) || !isFinite(plane[i]))) plane[i] = 0;
  }
  return result;
}

flat::NoiseResponse noiseResponse(const FilterResult& result) {
  const size_t width = size_t(result.data.width);
  flat::NoiseResponse response;
  for (size_t c = 0; c < 3; ++c) {
    const Parts parts(result, c);
    response.covariance[c] = varianceOf(result, c);
    response.spread[c] = response.covariance[c].copy();
    parallelFor(0, result.data.height, [&](int y) {
      for (size_t i = size_t(y) * width; i < size_t(y + 1) * width; ++i) {
        if (result.still[i]) continue;
        const auto [p0, p1] = partsOf(result.data.components.front().data.data() + 8 * i);
        const float d = result.differences.light[c][i], variance = response.covariance[c][i];
        const float own = ownCovariance(result, parts, i) * variance, spread = 0.25f * own;
        const float covariance =
            0.5f * (own - (p0 - p1) * result.bins[i].residual[c] * d - 0.5f * filteredDifference(result, c, i) * d);
        const float k = result.gates[i].k;  // F + k (y - F)
        response.covariance[c][i] = covariance + k * (variance - covariance);
        response.spread[c][i] = spread + k * k * (variance - spread);
      }
    });
  }
  return response;
}

}  // namespace fathom::deep
