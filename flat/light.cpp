#include "flat/light.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "base/parallel.h"
#include "flat/finite.h"
#include "flat/level.h"
#include "flat/neural_planes.h"
#include "flat/noise.h"

namespace fathom::flat {

namespace {

constexpr int kOctaves = 20;  // below and above the frame's level; what is beyond counts as there
constexpr double kVariances = 2, kMost = 0.25, kTolerance = 0.004;
constexpr double kFewest = 100;  // pixels whose residuals tell their variance
constexpr int kGrain = 1 << 14;

struct Place {
  int octave;
  float above;  // the part that belongs to the next one
};

// Of a brightness over the frame's level.
Place placeOf(float relative) {
  const auto bits = std::bit_cast<uint32_t>(relative);
  const int octave = int(bits >> 23) - 127 + kOctaves;
  if (octave < 0) return {0, 0};
  if (octave >= 2 * kOctaves) return {2 * kOctaves, 0};
  return {octave, float(bits & 0x7fffff) * 0x1p-23f};
}

// Denoised and rendered light, and the variance of their difference.
struct Sums {
  double pixels = 0, denoised = 0, render = 0, variance = 0;

  void add(double d, double n, double weight) {
    pixels += weight;
    denoised += weight * d;
    render += weight * n;
    variance += weight * weight * (n - d) * (n - d);
  }
  // What is to be added, of the denoised light.
  double lacking() const {
    const double missing = render - denoised;
    if (pixels < kFewest || !(missing * missing > kVariances * variance)) return 0;
    return std::clamp((missing - kVariances * variance / missing) / denoised, -kMost, kMost);
  }
};

float brightness(const std::array<std::span<const float>, 3>& rgb, size_t i) {
  return (rgb[0][i] + rgb[1][i] + rgb[2][i]) * (1.0f / 3);
}

}  // namespace

Buffer<float> lightFactors(const std::array<std::span<const float>, 3>& render, std::span<const uint8_t> settled,
                           const std::array<std::span<const float>, 3>& denoised) {
  const size_t pixels = settled.size();
  LevelSum levels;
  for (size_t i = 0; i < pixels; ++i)
    if (!settled[i]) levels.add(double(brightness(denoised, i)));
  const float level = levels.result(), scale = 1 / level;

  std::array<Sums, 2 * kOctaves + 2> sums;
  for (size_t i = 0; i < pixels; ++i) {
    const float d = brightness(denoised, i), n = brightness(render, i);
    if (settled[i] || !(d > 0) || !isFinite(n) || double(std::fabs(n)) > kAbsurd * double(level)) continue;
    const Place place = placeOf(d * scale);
    sums[size_t(place.octave)].add(double(d), double(n), 1 - double(place.above));
    sums[size_t(place.octave) + 1].add(double(d), double(n), double(place.above));
  }

  double light = 0, all = 0;
  for (const Sums& s : sums) light += s.denoised, all += s.denoised * s.lacking();
  if (!(std::fabs(all) > kTolerance * light)) return {};
  const double part = 1 - kTolerance * light / std::fabs(all);
  std::array<float, 2 * kOctaves + 2> ofOctave{};
  for (size_t j = 0; j < sums.size(); ++j) ofOctave[j] = float(1 + part * sums[j].lacking());
  Buffer<float> factors(pixels, 1.0f);
  parallelRanges(0, int(pixels), kGrain, [&](int first, int last) {
    for (size_t i = size_t(first); i < size_t(last); ++i) {
      const float d = brightness(denoised, i);
      if (settled[i] || !(d > 0)) continue;
      const Place place = placeOf(d * scale);
      const float here = ofOctave[size_t(place.octave)], next = ofOctave[size_t(place.octave) + 1];
      factors[i] = here + place.above * (next - here);
    }
  });
  return factors;
}

void keepLight(const Image& noisy, std::span<const uint8_t> settled, Image& denoised) {
  std::array<std::span<const float>, 3> render, colour;
  for (size_t c = 0; c < 3; ++c) {
    render[c] = noisy.get(kRgbNames[c]).values;
    colour[c] = denoised.get(kRgbNames[c]).values;
  }
  const Buffer<float> factors = lightFactors(render, settled, colour);
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
