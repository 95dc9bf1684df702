#include "flat/light.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "flat/finite.h"
#include "flat/level.h"
#include "flat/neural_planes.h"
#include "flat/noise.h"

namespace fathom::flat {

namespace {

constexpr double kVariances = 2, kMost = 0.25, kTolerance = 0.004;
constexpr double kFewest = 100;  // pixels whose residuals tell their variance
constexpr int kGrain = 1 << 14;

float brightness(const std::array<std::span<const float>, 3>& rgb, size_t i) {
  return (rgb[0][i] + rgb[1][i] + rgb[2][i]) * (1.0f / 3);
}

}  // namespace

void LightCurve::Sums::add(double d, double n, double weight) {
  pixels += weight;
  denoised += weight * d;
  render += weight * n;
  variance += weight * weight * (n - d) * (n - d);
}

void LightCurve::Sums::add(const Sums& other) {
  pixels += other.pixels;
  denoised += other.denoised;
  render += other.render;
  variance += other.variance;
}

// What is to be added, of the denoised light.
double LightCurve::Sums::lacking() const {
  const double missing = render - denoised;
  if (pixels < kFewest || !(missing * missing > kVariances * variance)) return 0;
  return std::clamp((missing - kVariances * variance / missing) / denoised, -kMost, kMost);
}

LightCurve::Place LightCurve::placeOf(float denoised) const {
  const auto bits = std::bit_cast<uint32_t>(denoised / level_);
  const int octave = int(bits >> 23) - 127 + kOctaves;
  if (octave < 0) return {0, 0};
  if (octave >= 2 * kOctaves) return {2 * kOctaves, 0};
  return {octave, float(bits & 0x7fffff) * 0x1p-23f};
}

void LightCurve::add(float denoised, float render) {
  if (!(denoised > 0) || !isFinite(render) || double(std::fabs(render)) > kAbsurd * double(level_)) return;
  const Place place = placeOf(denoised);
  sums_[size_t(place.octave)].add(double(denoised), double(render), 1 - double(place.above));
  sums_[size_t(place.octave) + 1].add(double(denoised), double(render), double(place.above));
}

void LightCurve::add(const LightCurve& other) {
  for (size_t j = 0; j < sums_.size(); ++j) sums_[j].add(other.sums_[j]);
}

void LightCurve::fit() {
  double light = 0, all = 0;
  for (const Sums& s : sums_) light += s.denoised, all += s.denoised * s.lacking();
  double left = std::max(0.0, std::fabs(all) - kTolerance * light);
  changes_ = left > 0;
  for (size_t j = sums_.size(); j-- > 0;) {
    const double lacking = sums_[j].lacking(), own = std::copysign(1.0, all) * lacking * sums_[j].denoised;
    const double taken = std::clamp(own, 0.0, left);
    factors_[j] = taken > 0 ? float(1 + taken / own * lacking) : 1;
    left -= taken;
  }
}

float LightCurve::factor(float denoised) const {
  if (!(denoised > 0)) return 1;
  const Place place = placeOf(denoised);
  const float here = factors_[size_t(place.octave)], next = factors_[size_t(place.octave) + 1];
  return here + place.above * (next - here);
}

Buffer<float> lightFactors(const std::array<std::span<const float>, 3>& render, std::span<const uint8_t> settled,
                           const std::array<std::span<const float>, 3>& denoised, float level) {
  const size_t pixels = settled.size();
  std::vector<LightCurve> parts(pixels / kGrain + 1, LightCurve(level));
  parallelRanges(0, int(pixels), kGrain, [&](int first, int last) {
    LightCurve& part = parts[size_t(first / kGrain)];
    for (size_t i = size_t(first); i < size_t(last); ++i)
      if (!settled[i]) part.add(brightness(denoised, i), brightness(render, i));
  });
  LightCurve curve(level);
  for (const LightCurve& part : parts) curve.add(part);
  curve.fit();
  if (!curve.changes()) return {};
  Buffer<float> factors(pixels, 1.0f);
  parallelRanges(0, int(pixels), kGrain, [&](int first, int last) {
    for (size_t i = size_t(first); i < size_t(last); ++i)
      if (!settled[i]) factors[i] = curve.factor(brightness(denoised, i));
  });
  return factors;
}

void keepLight(const Image& noisy, std::span<const uint8_t> settled, Image& denoised, float level) {
  std::array<std::span<const float>, 3> render, colour;
  for (size_t c = 0; c < 3; ++c) {
    render[c] = noisy.get(kRgbNames[c]).values;
    colour[c] = denoised.get(kRgbNames[c]).values;
  }
  const Buffer<float> factors = lightFactors(render, settled, colour, level);
  if (factors.empty()) return;
  for (const Light light : {Light::Whole, Light::Diffuse, Light::Specular})
    for (const char* c : kRgbNames) {
      Plane* plane = denoised.find(prefixOf(light) + c);
      if (!plane) continue;
      parallelRanges(0, int(factors.size()), kGrain, [&](int first, int last) {
        for (size_t i = size_t(first); i < size_t(last); ++i)
          plane->values[i] = std::clamp(plane->values[i] * factors[i], -kLargest, kLargest);
      });
    }
}

}  // namespace fathom::flat
