// Error estimates against the truth on Gaussian noise, where they must be unbiased, and the laws of their sums.
#include "flat/sure.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "tests/reference/noisy_flat.h"

namespace fathom::flat {
namespace {

using reference::boxDenoiser;
using reference::makeNoisyFlat;
using reference::NoisyFlat;
using reference::rangeDenoiser;

double sum(const Buffer<float>& values) {
  double total = 0;
  for (const float v : values) total += double(v);
  return total;
}

ErrorEstimate estimate(const Image& noisy, const Denoiser& denoiser, const SureParams& params = {}) {
  return estimateError(noisy, noiseOf(noisy), denoiser(noisy, {}), denoiser, params);
}

double trueError(const Image& image, const Image& truth, const char* channel) {
  const Buffer<float>&a = image.get(channel).values, &b = truth.get(channel).values;
  double total = 0;
  for (size_t i = 0; i < a.size(); ++i) total += (double(a[i]) - double(b[i])) * (double(a[i]) - double(b[i]));
  return total;
}

TEST(Sure, DivergenceOfALinearFilterIsItsTrace) {
  const int width = 23, height = 17, probes = 64;
  const Image noisy = makeNoisyFlat(width, height, 1).noisy;
  const ErrorEstimate e = estimate(noisy, boxDenoiser(), {.probes = probes});
  double trace = 0, error2 = 0, spread = 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double count = (1 + (x > 0) + (x < width - 1)) * (1 + (y > 0) + (y < height - 1)), s2 = 0.01;
      trace += s2 / count;
      spread += s2 / count;  // count pixels of weight 1 / count each
      // A probe adds s^2 w for every other pixel of the window, with random signs. Pairs of pixels share signs, each
      // pair in both: twice the variance.
      error2 += 2 * s2 * s2 * (count - 1) / (count * count) / probes;
    }
  EXPECT_NEAR(sum(e.covariance[0]), trace, 4 * std::sqrt(error2));
  EXPECT_LT(4 * std::sqrt(error2), 0.15 * trace);  // so that the line above can fail
  EXPECT_NEAR(sum(e.spread[0]), spread, 0.15 * spread);
}

// The t statistic of sums of estimate less truth over seeds, and that of the divergence's part in it.
struct Bias {
  double t = 0, ofDivergence = 0;
};

Bias biasOf(const Denoiser& denoiser, float noise) {
  constexpr int kSeeds = 40;
  double mean = 0, square = 0, divergence = 0;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const NoisyFlat frame = makeNoisyFlat(24, 18, seed, noise);
    const Image denoised = denoiser(frame.noisy, {});
    const ErrorEstimate e = estimateError(frame.noisy, noiseOf(frame.noisy), denoised, denoiser, {.seed = seed});
    double d = 0;
    for (size_t c = 0; c < 3; ++c) {
      d += sum(e.error[c]) - trueError(denoised, frame.truth, kRgbNames[c]);
      divergence += 2 * sum(e.covariance[c]) / kSeeds;
    }
    mean += d / kSeeds;
    square += d * d / kSeeds;
  }
  const double error = std::sqrt((square - mean * mean) / (kSeeds - 1));
  return {mean / error, divergence / error};
}

void expectUnbiased(const Denoiser& denoiser, float noise) {
  const Bias bias = biasOf(denoiser, noise);
  EXPECT_LT(std::abs(bias.t), 3.5);
  EXPECT_GT(bias.ofDivergence, 10);  // without it the line above would fail
}

TEST(Sure, IsUnbiasedForALinearFilter) {
  expectUnbiased(boxDenoiser(), 0.1f);
}

TEST(Sure, IsUnbiasedForAFilterThatFollowsTheColours) {
  expectUnbiased(rangeDenoiser(0.3f), 0.1f);
}

// Noise is the same in all channels up to its size: what a channel takes from the others counts.
TEST(Sure, IsUnbiasedForAFilterThatMixesChannels) {
  expectUnbiased(
      [](const Image& noisy, const Progress&) {
        Image result = reference::boxMean(noisy);
        for (size_t i = 0; i < noisy.dataWindow.area(); ++i) {
          float mean = 0;
          for (const char* c : kRgbNames) mean += result.get(c).values[i] / 3;
          for (const char* c : kRgbNames) result.find(c)->values[i] = mean;
        }
        return result;
      },
      0.1f);
}

// Weights made from one half filter the other, as our NL-Means does it: halves must move, and their mean with them.
TEST(Sure, IsUnbiasedForAFilterOfHalves) {
  expectUnbiased(
      [](const Image& noisy, const Progress&) {
        Image half = noisy.copy();
        Image result = noisy.copy();
        for (const char* c : kRgbNames) {
          const Buffer<float>&a = noisy.get(std::string("half0.") + c).values,
                &b = noisy.get(std::string("half1.") + c).values;
          for (size_t i = 0; i < a.size(); ++i) {
            // A value of one half weighed by the other's.
            const float w = 0.5f + 0.4f * std::sin(4 * b[i]), v = 0.5f + 0.4f * std::sin(4 * a[i]);
            result.find(c)->values[i] = 0.5f * (w * a[i] + v * b[i]);
          }
        }
        return result;
      },
      0.1f);
}

TEST(Sure, IsTheSameForAnyThreadsAndWindow) {
  const Image noisy = makeNoisyFlat(64, 40, 1).noisy;
  const ErrorEstimate many = estimate(noisy, boxDenoiser());
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const ErrorEstimate single = estimate(noisy, boxDenoiser());
  Image band{{-3, 12, 61, 30}, noisy.displayWindow, {}, noisy.attributes};
  for (const Plane& plane : noisy.planes) {
    Buffer<float>& values = band.add(plane.name).values;
    std::copy_n(plane.values.data() + 10 * 64, values.size(), values.data());
  }
  const ErrorEstimate ofBand = estimate(band, boxDenoiser());
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < many.error[c].size(); ++i) {
      ASSERT_EQ(many.error[c][i], single.error[c][i]);
      ASSERT_EQ(many.spread[c][i], single.spread[c][i]);
      const size_t row = i / 64;
      if (row <= 10 || row >= 27) continue;
      ASSERT_EQ(many.error[c][i], ofBand.error[c][i - 640]) << row;
    }
}

TEST(Sure, TakesAnySizeAndStepsOverWhatIsNotKnown) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(1, 9), std::pair(9, 1), std::pair(7, 5)}) {
    Image noisy = makeNoisyFlat(width, height, 1).noisy;
    noisy.find("R")->values[0] = nan;
    noisy.find("variance.G")->values[size_t(width * height) - 1] = infinity;
    const ErrorEstimate e = estimate(noisy, boxDenoiser());
    for (size_t c = 0; c < 3; ++c) {
      ASSERT_EQ(e.error[c].size(), size_t(width * height));
      for (const auto* plane : {&e.error[c], &e.spread[c], &e.covariance[c]})
        for (const float v : *plane) ASSERT_TRUE(std::isfinite(v));
      EXPECT_EQ(e.error[c][0], e.spread[c][0]);
      EXPECT_EQ(e.covariance[c][0], 0);
    }
  }
}

TEST(Sure, OfFramesWithoutNoiseIsTheSquaredResidual) {
  Image noisy = makeNoisyFlat(9, 7, 1).noisy;
  for (const char* c : kRgbNames) noisy.find(std::string("variance.") + c)->values.fill(0);
  const Image denoised = reference::boxMean(noisy);
  const ErrorEstimate e = estimate(noisy, boxDenoiser());
  for (size_t i = 0; i < 63; ++i) {
    const float residual = denoised.get("G").values[i] - noisy.get("G").values[i];
    EXPECT_EQ(e.error[1][i], residual * residual);
    EXPECT_EQ(e.spread[1][i], 0);
  }
}

// A response that the denoiser tells itself; where the noise is not known, or known to be none, it says nothing.
TEST(Sure, TakesATellingDenoisersWord) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Image noisy = makeNoisyFlat(9, 7, 1).noisy;
  const Image denoised = reference::boxMean(noisy);
  noisy.find("G")->values[3] = nan;
  for (const char* c : kRgbNames) noisy.find(std::string("variance.") + c)->values[5] = 0;
  NoiseResponse response;
  for (size_t c = 0; c < 3; ++c) {
    response.covariance[c] = Buffer<float>(63, 0.003f);
    response.spread[c] = Buffer<float>(63, 0.002f);
  }
  response.covariance[1][8] = nan;
  const Noise noise = noiseOf(noisy);
  const ErrorEstimate e = estimateError(noisy, noise, denoised, std::move(response));
  for (size_t i = 0; i < 63; ++i) {
    const float residual = denoised.get("G").values[i] - noisy.get("G").values[i];
    const bool tells = i != 3 && i != 5 && i != 8;
    EXPECT_EQ(e.covariance[1][i], tells ? 0.003f : 0) << i;
    if (i == 3)
      EXPECT_EQ(e.error[1][i], 0.002f);
    else
      EXPECT_FLOAT_EQ(e.error[1][i], residual * residual - noise.variance[1][i] + 2 * e.covariance[1][i]) << i;
  }
}

// A denoiser that multiplies, with a value to put into a pixel of the answer of one run; the step squared is the variance,
// so that all is known without chance.
struct Multiplies {
  float factor;
  int odd = -1;  // of the runs beside the first
  float value = 0;

  ErrorEstimate of(const Image& noisy, const SureParams& params) const {
    int runs = 0;
    const Denoiser denoiser = [&](const Image& image, const Progress&) {
      Image result = image.copy();
      for (const char* c : kRgbNames)
        for (float& v : result.find(c)->values) v *= factor;
      if (runs == odd + 1) result.find("R")->values[5] = value;
      ++runs;
      return result;
    };
    const Image denoised = denoiser(noisy, {});
    return estimateError(noisy, noiseOf(noisy), denoised, denoiser, params);
  }
};

Image constantImage(float value, float variance) {
  Image image{{0, 0, 4, 3}, {0, 0, 4, 3}, {}, {}};
  for (const char* c : kRgbNames) {
    image.add(c, value);
    image.add(std::string("variance.") + c, variance);
  }
  return image;
}

TEST(Sure, ARunThatFailsInAPixelSaysNothingThere) {
  const Image noisy = constantImage(1, 0.25f);
  for (const float odd : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e20f}) {
    const ErrorEstimate e = Multiplies{0.5f, 1, odd}.of(noisy, {.probes = 2, .size = 0.5f});
    for (size_t i = 0; i < 12; ++i) {
      const float runs = i == 5 ? 0.5f : 1;
      EXPECT_FLOAT_EQ(e.covariance[0][i], 0.5f * 0.25f * runs);
      EXPECT_FLOAT_EQ(e.spread[0][i], 0.25f * 0.25f * runs);
      EXPECT_FLOAT_EQ(e.error[0][i], 0.25f - 0.25f + 2 * e.covariance[0][i]);
    }
  }
}

TEST(Sure, WhatIsTooLargeToBeFiniteIsNotKnown) {
  // The residual's square: the spread is all that is known.
  const ErrorEstimate far = Multiplies{0.5f}.of(constantImage(1e8f, 1e12f), {.size = 0.5f});
  // The spread, and with it the error.
  const ErrorEstimate wide = Multiplies{1e6f}.of(constantImage(0, 1e6f), {.size = 0.5f});
  for (size_t i = 0; i < 12; ++i) {
    EXPECT_NEAR(far.spread[1][i], 0.25e12, 1e8);
    EXPECT_EQ(far.error[1][i], far.spread[1][i]);
    EXPECT_EQ(far.covariance[1][i], 0);
    EXPECT_EQ(wide.spread[1][i], 0);
    EXPECT_EQ(wide.error[1][i], -1e6f) << "of a residual of 0 the noise is taken";
    EXPECT_EQ(wide.covariance[1][i], 0);
  }
}

TEST(Sure, NoProbesAreOne) {
  const Image noisy = makeNoisyFlat(9, 7, 1).noisy;
  const ErrorEstimate none = estimate(noisy, boxDenoiser(), {.probes = 0}),
                      one = estimate(noisy, boxDenoiser(), {.probes = 1});
  for (size_t i = 0; i < 63; ++i) EXPECT_EQ(none.error[0][i], one.error[0][i]);
  EXPECT_GT(sum(one.spread[0]), 0);
}

TEST(Sure, ADenoiserOfAnotherSizeIsRefused) {
  const Image noisy = makeNoisyFlat(9, 7, 1).noisy, other = makeNoisyFlat(9, 6, 1).noisy;
  const Noise noise = noiseOf(noisy);
  const Denoiser identity = [](const Image& image, const Progress&) { return image.copy(); };
  const Denoiser cuts = [&](const Image&, const Progress&) { return other.copy(); };
  EXPECT_THROW(estimateError(noisy, noise, noisy, cuts), Error);
  EXPECT_THROW(estimateError(noisy, noise, other, identity), Error);
}

TEST(Sure, StopsWhenTold) {
  std::stop_source stop;
  stop.request_stop();
  const Image noisy = makeNoisyFlat(9, 7, 1).noisy;
  EXPECT_THROW(estimateError(noisy, noiseOf(noisy), noisy, boxDenoiser(), {}, {{}, stop.get_token()}), Cancelled);
}

}  // namespace
}  // namespace fathom::flat
