// The mix of a pixel against its equations in double precision.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "flat/progressive.h"
#include "tests/reference/noisy_flat.h"

namespace fathom::flat {
namespace {

using reference::makeNoisyFlat;
using reference::NoisyFlat;

// A map and what else the mix takes of each pixel, all filled with different values.
struct MapOf {
  ErrorMap map;
  Buffer<float> k;

  explicit MapOf(size_t pixels) : k(pixels) {
    for (size_t c = 0; c < 3; ++c)
      for (auto* planes : {&map.error, &map.variance, &map.covariance}) (*planes)[c] = Buffer<float>(pixels);
    for (size_t i = 0; i < pixels; ++i) {
      k[i] = float(i % 4) / 4;
      for (size_t c = 0; c < 3; ++c) {
        map.error[c][i] = 1e-3f * float(i);
        map.variance[c][i] = 4e-3f * float(i % 6);
        map.covariance[c][i] = 1e-3f * float(i % 3);
      }
    }
  }
};

// Equations 9 and 8 with the departures of the header. `odds`: how many times as likely the denoised value is made.
void expectMix(const Image& noisy, const Noise& noise, const Image& denoised, const MapOf& of,
               const Buffer<float>& odds, const std::function<double(size_t)>& factor) {
  const Image result = mix(noisy, noise, denoised, of.map, of.k, odds);
  for (size_t i = 0; i < of.k.size(); ++i)
    for (size_t c = 0; c < 3; ++c) {
      const double e = double(of.map.error[c][i]), v = double(of.map.variance[c][i]),
                   f = double(of.map.covariance[c][i]);
      const double n = double(noise.samples[i]), doubt = n > 1 ? (n + 11) / (n - 1) : 1;
      const double s = doubt * std::max(v, double(noise.variance[c][i]));
      const double ours = factor(i) * std::max(s - f, 0.0), theirs = std::max(e - f, 0.0);
      const double a = std::min(theirs > 0 ? ours / (ours + theirs) : 1, 1 - double(of.k[i]) / doubt);
      const double x = double(noisy.get(kRgbNames[c]).values[i]), y = double(denoised.get(kRgbNames[c]).values[i]);
      EXPECT_NEAR(result.get(kRgbNames[c]).values[i], x + a * (y - x), 1e-5) << i;
      EXPECT_NEAR(result.get(std::string("error.") + kRgbNames[c]).values[i],
                  std::max(0.0, (1 - a) * (1 - a) * v + a * a * e + 2 * a * (1 - a) * f), 1e-6);
    }
}

TEST(Progressive, MixesByEquation9) {
  const NoisyFlat frame = makeNoisyFlat(7, 5, 1, 0.1f);
  const Image denoised = reference::boxMean(frame.noisy);
  MapOf of(35);
  const auto same = [](size_t) { return 1.0; };
  expectMix(frame.noisy, noiseOf(frame.noisy), denoised, of, {}, same);
  // Covariances larger than the variances and errors, less than nothing, and between both.
  for (size_t i = 0; i < 35; ++i) {
    of.map.covariance[0][i] = 0.1f;
    of.map.covariance[1][i] = -0.02f;
    of.map.covariance[2][i] = 0.025f;
  }
  expectMix(frame.noisy, noiseOf(frame.noisy), denoised, of, {}, same);
}

TEST(Progressive, FewSamplesAreDoubted) {
  NoisyFlat frame = makeNoisyFlat(7, 5, 1, 0.1f);
  const float counts[] = {0, 1, 1.25f, 1.5f, 2, 3, 8, 32, 1e6f};
  Buffer<float>& samples = frame.noisy.add("samples").values;
  for (size_t i = 0; i < 35; ++i) samples[i] = counts[i % 9];
  expectMix(frame.noisy, noiseOf(frame.noisy), reference::boxMean(frame.noisy), MapOf(35), {},
            [](size_t) { return 1.0; });
}

TEST(Progressive, OddsTiltTheShareUpToABound) {
  const NoisyFlat frame = makeNoisyFlat(7, 5, 1, 0.1f);
  Buffer<float> odds(35);
  for (size_t i = 0; i < 35; ++i) odds[i] = 0.25f * (float(i) - 17);
  expectMix(frame.noisy, noiseOf(frame.noisy), reference::boxMean(frame.noisy), MapOf(35), odds,
            [](size_t i) { return std::exp(std::clamp(0.25 * (double(i) - 17), -2.0, 2.0)); });
}

// Beside a render of 1e12 a difference would leave nothing of it.
TEST(Progressive, AllOfTheDenoisedValueIsThatValue) {
  NoisyFlat frame = makeNoisyFlat(4, 3, 1, 0.1f);
  const Image denoised = reference::boxMean(frame.noisy);
  for (const char* c : kRgbNames) frame.noisy.find(c)->values.fill(1e12f);
  MapOf of(12);
  of.k.fill(0);
  for (Buffer<float>& error : of.map.error) error.fill(0);
  const Image result = mix(frame.noisy, noiseOf(frame.noisy), denoised, of.map, of.k);
  for (size_t i = 0; i < 12; ++i) EXPECT_EQ(result.get("G").values[i], denoised.get("G").values[i]);
}

TEST(Progressive, WhatIsNotMixedHasTheErrorOfWhatStandsThere) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  NoisyFlat frame = makeNoisyFlat(4, 3, 1, 0.1f);
  Image denoised = reference::boxMean(frame.noisy);
  frame.noisy.find("R")->values[3] = nan;                                                         // the render, in R
  denoised.find("G")->values[5] = nan;                                                            // the denoiser, in G
  for (const char* c : kRgbNames) frame.noisy.find(std::string("variance.") + c)->values[7] = 0;  // converged
  const MapOf of(12);
  const Image result = mix(frame.noisy, noiseOf(frame.noisy), denoised, of.map, of.k);
  EXPECT_EQ(result.get("error.R").values[3], of.map.error[0][3]);
  EXPECT_EQ(result.get("error.G").values[3], of.map.error[1][3]);
  EXPECT_EQ(result.get("error.G").values[5], frame.noisy.get("variance.G").values[5]);
  EXPECT_EQ(result.get("error.G").values[7], 0);
}

}  // namespace
}  // namespace fathom::flat
