// The error map against its formulas in double precision, and its laws.
#include "flat/error_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/reference/bilateral.h"
#include "tests/reference/noisy_flat.h"
#include "tests/reference/simd_targets.h"

namespace fathom::flat {
namespace {

using reference::boxDenoiser;
using reference::makeNoisyFlat;
using reference::NoisyFlat;

Padded plane(const Image& image, const Buffer<float>& values) {
  Padded result(image.dataWindow.width(), image.dataWindow.height(), 5);
  for (int y = 0; y < image.dataWindow.height(); ++y)
    std::copy_n(values.data() + size_t(y) * size_t(image.dataWindow.width()), image.dataWindow.width(), result.row(y));
  result.extend();
  return result;
}

void expectLikeTwin(int width, int height) {
  const NoisyFlat frame = makeNoisyFlat(width, height, 3, 0.05f);
  const Noise noise = noiseOf(frame.noisy);
  const Image denoised = reference::boxMean(frame.noisy);
  const ErrorEstimate e = estimateError(frame.noisy, noise, denoised, boxDenoiser());
  const ErrorMap map = mapErrors(e, noise, denoised);
  double sure = 0, spread = 0, variance = 0;
  std::vector<Padded> guide;
  for (size_t c = 0; c < 3; ++c) {
    guide.push_back(plane(denoised, denoised.get(kRgbNames[c]).values));
    for (size_t i = 0; i < e.error[c].size(); ++i) {
      sure += double(e.error[c][i]);
      spread += double(e.spread[c][i]);
      variance += double(noise.variance[c][i]);
    }
  }
  const double ratio = std::clamp(sure / spread, 1.0, 100.0), rest = std::max(0.0, sure - ratio * spread) / variance;
  const BilateralParams params{.radius = 5, .sigma = 2.5f, .sharpness = 2, .floor = 4e-4f * noise.level * noise.level};
  for (size_t c = 0; c < 3; ++c) {
    Buffer<float> squares(e.error[c].size());
    for (size_t i = 0; i < squares.size(); ++i) squares[i] = noise.variance[c][i] * noise.variance[c][i];
    std::vector<Padded> in, square;
    for (const auto* values : {&e.error[c], &e.spread[c], &noise.variance[c], &e.covariance[c]})
      in.push_back(plane(denoised, *values));
    square.push_back(plane(denoised, squares));
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const auto mean = reference::bilateral(x, y, params, guide, in);
        const double n = 4 * reference::bilateral(x, y, params, guide, square, true)[0];
        const double p = ratio * mean[1] + rest * mean[2];
        const double error = std::max((mean[0] * p * p + p * n) / (p * p + n), 0.5 * mean[1]);
        const size_t i = size_t(y * width + x);
        ASSERT_NEAR(map.error[c][i], error, 1e-4 * error) << x << ", " << y;
        ASSERT_NEAR(map.variance[c][i], mean[2], 1e-4 * mean[2]);
        ASSERT_NEAR(map.covariance[c][i], std::clamp(mean[3], 0.0, std::sqrt(mean[2] * error)), 1e-4 * mean[2]);
      }
  }
}

TEST(ErrorMap, EqualsItsTwin) {
  forSimdTargets([] {
    for (const auto& [width, height] : {std::pair(1, 1), std::pair(1, 9), std::pair(9, 1), std::pair(21, 15)})
      expectLikeTwin(width, height);
  });
}

double sum(const Buffer<float>& values) {
  double total = 0;
  for (const float v : values) total += double(v);
  return total;
}

// A denoiser that answers nothing passes no noise on; its error is all bias.
TEST(ErrorMap, KnowsADenoiserThatDoesNotLook) {
  const NoisyFlat frame = makeNoisyFlat(48, 40, 1, 0.1f);
  const Denoiser grey = [](const Image& noisy, const Progress&) {
    Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
    for (const char* c : kRgbNames) result.add(c, 0.4f);
    return result;
  };
  const Image denoised = grey(frame.noisy, {});
  const Noise noise = noiseOf(frame.noisy);
  const ErrorMap map = mapErrors(estimateError(frame.noisy, noise, denoised, grey), noise, denoised);
  double truth = 0;
  for (const float v : frame.truth.get("R").values) truth += (double(v) - 0.4) * (double(v) - 0.4);
  EXPECT_NEAR(sum(map.error[0]), truth, 0.15 * truth);
}

TEST(ErrorMap, SumsToTheTruthAndFollowsIt) {
  const NoisyFlat frame = makeNoisyFlat(64, 48, 1, 0.1f);
  const Image denoised = reference::boxMean(frame.noisy);
  const Noise noise = noiseOf(frame.noisy);
  const ErrorMap map =
      mapErrors(estimateError(frame.noisy, noise, denoised, boxDenoiser(), {.probes = 4}), noise, denoised);
  double truth = 0;
  for (size_t i = 0; i < 64 * 48; ++i) {
    const double e = double(denoised.get("R").values[i]) - double(frame.truth.get("R").values[i]);
    truth += e * e;
  }
  EXPECT_NEAR(sum(map.error[0]), truth, 0.2 * truth);
}

TEST(ErrorMap, IsZeroWithoutNoiseAndResidual) {
  const NoisyFlat frame = makeNoisyFlat(12, 9, 1, 0);
  const Denoiser identity = [](const Image& noisy, const Progress&) { return noisy.copy(); };
  const Noise noise = noiseOf(frame.noisy);
  const ErrorMap map = mapErrors(estimateError(frame.noisy, noise, frame.noisy, identity), noise, frame.noisy);
  for (const auto& planes : {&map.error, &map.variance, &map.covariance})
    for (const Buffer<float>& values : *planes)
      for (const float v : values) EXPECT_EQ(v, 0);
}

TEST(ErrorMap, StaysFiniteAndNotNegativeForAnyValues) {
  const float infinity = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  NoisyFlat frame = makeNoisyFlat(17, 13, 1, 0.1f);
  const float odd[] = {0, 1e15f, -1e15f, infinity, nan, 1e-30f};
  for (size_t i = 0; i < 6; ++i) {
    frame.noisy.find("R")->values[10 + 30 * i] = odd[i];
    frame.noisy.find("variance.G")->values[20 + 30 * i] = odd[i];
  }
  const Denoiser identity = [](const Image& noisy, const Progress&) { return noisy.copy(); };
  const Noise noise = noiseOf(frame.noisy);
  for (const Denoiser& denoiser : {identity, boxDenoiser()}) {
    const Image denoised = denoiser(frame.noisy, {});
    const ErrorMap map = mapErrors(estimateError(frame.noisy, noise, denoised, denoiser), noise, denoised);
    for (const auto& planes : {&map.error, &map.variance, &map.covariance})
      for (const Buffer<float>& values : *planes)
        for (const float v : values) ASSERT_TRUE(std::isfinite(v) && v >= 0) << v;
  }
}

}  // namespace
}  // namespace fathom::flat
