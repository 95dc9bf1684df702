// The mixing network's planes against their definition in double precision, with values at all bounds.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "flat/mix_planes.h"
#include "flat/neural_planes.h"

namespace fathom::flat {
namespace {

constexpr int kWidth = 20, kHeight = 12;
constexpr size_t kPixels = size_t(kWidth) * kHeight;

// A frame about as bright as `light`, and one candidate, with some values of every kind beyond their bounds.
struct Case {
  Image noisy{{0, 0, kWidth, kHeight}, {0, 0, kWidth, kHeight}, {}, {}};
  Noise noise;
  std::vector<Candidate> candidates;

  explicit Case(double light) {
    std::mt19937 random(5);
    const auto fill = [&](Buffer<float>& values, double low, double high) {
      values = Buffer<float>(kPixels);
      std::uniform_real_distribution<double> between(low, high);
      for (float& v : values) v = float(between(random));
    };
    Candidate& one = candidates.emplace_back();
    one.denoised.dataWindow = one.denoised.displayWindow = noisy.dataWindow;
    for (size_t c = 0; c < 3; ++c) {
      const std::string name = kRgbNames[c];
      fill(noisy.add(name).values, -0.2 * light, light);
      fill(noisy.add("albedo." + name).values, -0.5, 1.5);
      fill(noisy.add(std::string("N.") + "XYZ"[c]).values, -1.5, 1.5);
      fill(one.denoised.add(name).values, -0.2 * light, light);
      fill(noise.variance[c], 0, 0.1 * light * light);
      fill(one.map.error[c], 0, 0.02 * light * light);
      fill(one.map.variance[c], 0, 0.1 * light * light);
      fill(one.map.covariance[c], 0, 0.01 * light * light);
      fill(one.spread[c], 0, 0.01 * light * light);
      noise.variance[c][7] = one.map.variance[c][7] = 0;  // a residual, and a covariance, of nothing
    }
    fill(noisy.add("Z").values, -1, 10);
    fill(noise.samples, 1, 100);
    fill(one.k, 0, 1);
  }

  // Of one pixel, by plane.
  std::vector<float> found(bool own, size_t i) const {
    const nn::MixSource source = mixSource(noisy, noise, candidates);
    const size_t planes = own ? nn::kMixOwn : nn::kMixShared;
    const nn::Window window{int(i % kWidth), int(i / kWidth), 1, 1};
    std::vector<float> values(planes);
    const nn::Planes to = nn::denseRows(values.data(), int(planes), 1, 1);
    if (own)
      source.own(0, window, to);
    else
      source.shared(window, to);
    return values;
  }
};

double logarithm(double relative) {
  return (std::log(relative + 1e-6) + 5) / 3;
}

// The header's table. `absurd`: the pixel whose depth and error do not count in means over the frame.
struct Twin {
  const Case& of;
  double scale, depth = 1, frame = 0;

  Twin(const Case& c, size_t absurd = kPixels) : of(c), scale(double(exposureOf(c.noisy))) {
    double sum = 0, count = 0, errors = 0, all = 0;
    for (size_t i = 0; i < kPixels; ++i) {
      if (i == absurd) continue;
      const double z = double(c.noisy.get("Z").values[i]);
      if (z > 0) sum += z, ++count;
      errors += relative(c.candidates[0].map.error, i), ++all;
    }
    if (count > 0) depth = sum / count;
    frame = errors / all;
  }

  double bounded(float value, double by) const {
    const double finite = std::abs(value) <= 1e15f ? double(value) : 0;
    return std::clamp(finite * by, -1e15, 1e15);
  }
  double render(size_t c, size_t i) const { return bounded(of.noisy.get(kRgbNames[c]).values[i], scale); }
  double denoised(size_t c, size_t i) const {
    return std::max(0.0, bounded(of.candidates[0].denoised.get(kRgbNames[c]).values[i], scale));
  }
  double sum(const std::array<Buffer<float>, 3>& planes, size_t i) const {
    double result = 0;
    for (const Buffer<float>& plane : planes) result += bounded(plane[i], scale * scale);
    return result;
  }
  double level(size_t i) const {
    const double mean = (denoised(0, i) + denoised(1, i) + denoised(2, i)) / 3;
    return mean * mean + 0.01;
  }
  double relative(const std::array<Buffer<float>, 3>& planes, size_t i) const { return sum(planes, i) / 3 / level(i); }

  std::vector<double> shared(size_t i) const {
    std::vector<double> result(12);
    double mean = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double x = std::max(0.0, render(c, i));
      mean += x / 3;
      result[c] = std::log1p(x);
      result[3 + c] = std::clamp(double(of.noisy.get(std::string("albedo.") + kRgbNames[c]).values[i]), 0.0, 1.0);
      result[6 + c] = std::clamp(double(of.noisy.get(std::string("N.") + "XYZ"[c]).values[i]), -1.0, 1.0);
    }
    const double z = std::max(0.0, double(of.noisy.get("Z").values[i]));
    result[9] = z / (z + depth);
    result[10] = logarithm(sum(of.noise.variance, i) / 3 / (mean * mean + 0.01));
    result[11] = std::log2(double(of.noise.samples[i])) / 4 - 1;
    return result;
  }

  std::vector<double> own(size_t i) const {
    const Candidate& one = of.candidates[0];
    double residual = 0;
    for (size_t c = 0; c < 3; ++c) residual += denoised(c, i) - render(c, i);
    const double deviation = std::sqrt(sum(of.noise.variance, i) + 1e-4 * level(i));
    return {std::log1p(denoised(0, i)),
            std::log1p(denoised(1, i)),
            std::log1p(denoised(2, i)),
            logarithm(relative(one.map.error, i)),
            logarithm(relative(one.spread, i)),
            logarithm(relative(one.map.variance, i)),
            sum(one.map.covariance, i) / (sum(one.map.variance, i) + 1e-6 * level(i)),
            std::clamp(residual / deviation, -4.0, 4.0),
            double(one.k[i]),
            logarithm(frame)};
  }
};

void expectTwin(const Case& c, size_t absurd = kPixels) {
  const Twin twin(c, absurd);
  for (size_t i = 0; i < kPixels; ++i)
    for (const bool own : {false, true}) {
      const std::vector<float> found = c.found(own, i);
      const std::vector<double> expected = own ? twin.own(i) : twin.shared(i);
      for (size_t p = 0; p < found.size(); ++p)
        ASSERT_NEAR(found[p], expected[p], 2e-5 + 1e-5 * std::abs(expected[p]))
            << (own ? "own " : "shared ") << p << ", pixel " << i;
    }
}

TEST(MixPlanes, AreTheirFormulas) {
  for (const double light : {1.0, 1e-8, 1e7}) expectTwin(Case(light));
}

// One pixel of a million times the others' depth and error, where it is and elsewhere; and light that ends at the bound.
TEST(MixPlanes, AnAbsurdPixelDecidesNothing) {
  for (const float odd : {1e12f, 1e15f}) {
    Case c(1e-3);
    for (size_t k = 0; k < 3; ++k) {
      c.noisy.find(kRgbNames[k])->values[33] = odd;
      c.noise.variance[k][33] = odd;
      c.candidates[0].map.error[k][33] = 1e-9f * odd;
      c.candidates[0].denoised.find(kRgbNames[k])->values[51] = odd;
      c.noisy.find(kRgbNames[k])->values[52] = -odd;
    }
    c.noisy.find("Z")->values[33] = odd;
    expectTwin(c, 33);
  }
}

TEST(MixPlanes, WithoutDepthsThereAreNone) {
  Case c(1);
  c.noisy.find("Z")->values.fill(0);
  for (const float v : {c.found(false, 3)[9], c.found(false, 80)[9]}) EXPECT_EQ(v, 0);
}

TEST(MixPlanes, TwoOfThreeChannelsAreNone) {
  Case c(1);
  std::erase_if(c.noisy.planes, [](const Plane& plane) { return plane.name == "albedo.B" || plane.name == "N.Y"; });
  const std::vector<float> found = c.found(false, 5);
  for (size_t p = 3; p < 9; ++p) EXPECT_EQ(found[p], 0);
}

// Light and depths in any unit: as dark as floats go, with and without a pixel that is not.
TEST(MixPlanes, AreFiniteInAnyUnit) {
  for (const double unit : {1e-44, 1e-38, 1e-30, 1e-20, 1e7, 1e15})
    for (const float odd : {0.0f, 1.0f, 1e15f}) {
      Case c(unit);
      for (float& z : c.noisy.find("Z")->values) z = float(double(z) * std::min(unit, 1e14));
      for (const char* name : {"R", "G", "B", "Z"}) c.noisy.find(name)->values[33] = odd;
      c.candidates[0].spread[0][40] = -1;
      for (const size_t i : {0U, 7U, 33U, 40U})
        for (const bool own : {false, true})
          for (const float v : c.found(own, i)) ASSERT_TRUE(std::isfinite(v)) << unit << ", " << odd << ", pixel " << i;
    }
}

}  // namespace
}  // namespace fathom::flat
