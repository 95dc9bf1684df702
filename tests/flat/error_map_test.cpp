// The error map against its formulas in double precision, and its laws.
#include "flat/error_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cfloat>
#include <limits>
#include <random>
#include <tuple>

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

double finite(float value) {
  return std::abs(value) <= 1e15f ? double(value) : 0;
}

// The header's formulas. `absurd`: the pixel that does not count in the sums over the frame.
void expectTwin(const ErrorEstimate& e, const Noise& noise, const Image& denoised, size_t absurd = ~size_t(0)) {
  const ErrorMap map = mapErrors(e, noise, denoised);
  const int width = denoised.dataWindow.width(), height = denoised.dataWindow.height();
  double sure = 0, spread = 0, variance = 0;
  std::vector<Padded> guide;
  for (size_t c = 0; c < 3; ++c) {
    Buffer<float> colours = denoised.get(kRgbNames[c]).values.copy();
    for (float& v : colours) v = float(finite(v));
    guide.push_back(plane(denoised, colours));
    for (size_t i = 0; i < e.error[c].size(); ++i) {
      if (i == absurd) continue;
      sure += double(e.error[c][i]);
      spread += double(e.spread[c][i]);
      variance += double(noise.variance[c][i]);
    }
  }
  const double ratio = spread > 0 ? std::clamp(sure / spread, 1.0, 100.0) : 1;
  const double rest = variance > 0 ? std::max(0.0, sure - ratio * spread) / variance : 0;
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
        const double squared = reference::bilateral(x, y, params, guide, square, true)[0];
        const double n = squared < double(FLT_MIN) ? 0 : 4 * squared;
        const double p = ratio * mean[1] + rest * mean[2];
        const double mixed = p * p + n > 0 ? (mean[0] * p * p + p * n) / (p * p + n) : std::max(mean[0], 0.0);
        const double error = std::max(mixed, 0.5 * mean[1]);
        const size_t i = size_t(y * width + x);
        ASSERT_NEAR(map.error[c][i], error, 1e-4 * error) << x << ", " << y;
        ASSERT_NEAR(map.variance[c][i], mean[2], 1e-4 * mean[2]);
        ASSERT_NEAR(map.covariance[c][i], std::clamp(mean[3], 0.0, std::sqrt(mean[2] * error)),
                    1e-4 * std::sqrt(mean[2] * error));
      }
  }
}

void expectLikeTwin(int width, int height) {
  const NoisyFlat frame = makeNoisyFlat(width, height, 3, 0.05f);
  const Noise noise = noiseOf(frame.noisy);
  const Image denoised = reference::boxMean(frame.noisy);
  expectTwin(estimateError(frame.noisy, noise, denoised, boxDenoiser()), noise, denoised);
}

TEST(ErrorMap, EqualsItsTwin) {
  forSimdTargets([] {
    for (const auto& [width, height] : {std::pair(1, 1), std::pair(1, 9), std::pair(9, 1), std::pair(21, 15)})
      expectLikeTwin(width, height);
  });
}

// Estimates as no denoiser need make them: variances about `size`, the others in these proportions to it.
struct HandMade {
  Image denoised{{0, 0, 26, 9}, {0, 0, 26, 9}, {}, {}};
  ErrorEstimate estimate;
  Noise noise;

  HandMade(float size, double error, double spread, double covariance = 0.05) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> about(0.5, 1.5);
    const size_t pixels = denoised.dataWindow.area();
    const auto fill = [&](Buffer<float>& plane, double value) {
      plane = Buffer<float>(pixels);
      for (float& v : plane) v = float(value * about(random));
    };
    noise.level = std::sqrt(size);
    for (size_t c = 0; c < 3; ++c) {
      fill(denoised.add(kRgbNames[c]).values, double(noise.level));
      fill(noise.variance[c], double(size));
      fill(estimate.error[c], error * double(size));
      fill(estimate.spread[c], spread * double(size));
      fill(estimate.covariance[c], covariance * double(size));
    }
  }
  void expect(size_t absurd = ~size_t(0)) const { expectTwin(estimate, noise, denoised, absurd); }
};

TEST(ErrorMap, EqualsItsTwinWhateverTheProportions) {
  HandMade(1, 0.2, 0.05).expect();
  HandMade(1, 0.01, 0.05).expect();  // less than the spread
  HandMade(1, -0.2, 0.05).expect();  // than nothing
  HandMade(1, 2, 0.001).expect();    // beyond the largest ratio
  HandMade(1, 2, 0).expect();
  HandMade(1, 0.2, 0.05, -0.05).expect();
  HandMade(1, 0.2, 0.05, 5).expect();  // more covariance than there can be
}

TEST(ErrorMap, EqualsItsTwinForTheLeastAndTheLargestValues) {
  for (const float size : {1e-29f, 1e-21f, 1e-17f, 1e-9f, 1e9f, 4e14f}) {
    SCOPED_TRACE(size);
    HandMade(size, 0.2, 0.05).expect();
    HandMade(size, 0.01, 0.0005, 0.005).expect();
  }
}

// Where nothing is expected, neither by what the filter passes on nor by the noise, stands the residual.
TEST(ErrorMap, WithoutNoiseIsTheResidual) {
  for (const bool everywhere : {false, true}) {
    HandMade made(1, 0.2, 0.05);
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < made.denoised.dataWindow.area(); ++i) {
        const size_t x = i % 26;
        if (!everywhere && x >= 13) continue;
        made.noise.variance[c][i] = made.estimate.covariance[c][i] = 0;
        if (!everywhere) made.estimate.spread[c][i] = 0;
        made.estimate.error[c][i] = everywhere ? 50 : i / 26 < 4 ? 0.3f : -0.3f;
      }
    made.expect();
  }
}

// The mean of nothing but noise is nothing: the sums over the frame say that there is no error.
TEST(ErrorMap, IsZeroWhereErrorsCancelAndNothingIsPassedOn) {
  HandMade made(1, 0, 0, 0);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < made.denoised.dataWindow.area(); ++i) made.estimate.error[c][i] = i % 26 < 13 ? 0.5f : -0.5f;
  made.expect();
}

// What one pixel says of the frame, far from where its own values are.
TEST(ErrorMap, OnlyWhatIsAbsurdDoesNotCountInTheFrame) {
  constexpr size_t kPixel = 4 * 26 + 12;
  for (const auto& [error, spread, counts] :
       {std::tuple(2e4f, 1e4f, true), std::tuple(8e7f, 8e7f, false), std::tuple(8e14f, 8e14f, false)}) {
    SCOPED_TRACE(error);
    HandMade made(1, 0.4, 0.05);
    for (size_t c = 0; c < 3; ++c) {
      made.estimate.error[c][kPixel] = error;
      made.estimate.spread[c][kPixel] = spread;
    }
    made.expect(counts ? ~size_t(0) : kPixel);
  }
}

// As they are where a caller makes them: what is no number counts as 0, and not in the frame.
TEST(ErrorMap, AnEstimateThatIsNotFiniteIsNothing) {
  constexpr size_t kPixel = 4 * 26 + 12;
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  for (const float odd : {inf, -inf, nan, 1e35f}) {
    HandMade none(1, 0.2, 0.05), made(1, 0.2, 0.05);
    for (size_t c = 0; c < 3; ++c) {
      none.estimate.error[c][kPixel] = none.estimate.spread[c][kPixel] = none.estimate.covariance[c][kPixel] = 0;
      made.estimate.error[c][kPixel] = made.estimate.spread[c][kPixel] = made.estimate.covariance[c][kPixel] = odd;
    }
    const ErrorMap expected = mapErrors(none.estimate, none.noise, none.denoised),
                   found = mapErrors(made.estimate, made.noise, made.denoised);
    for (size_t i = 0; i < none.denoised.dataWindow.area(); ++i) {
      ASSERT_NEAR(found.error[1][i], expected.error[1][i], 0.01f * expected.error[1][i]) << odd << ", pixel " << i;
      ASSERT_NEAR(found.covariance[1][i], expected.covariance[1][i], 1e-6f);
    }
  }
}

TEST(ErrorMap, ADenoisedValueThatIsNotFiniteGuidesAsNothing) {
  for (const float odd : {1e25f, -1e25f, std::numeric_limits<float>::infinity()}) {
    HandMade made(1, 0.2, 0.05);
    made.denoised.find("G")->values[120] = odd;
    made.expect();
  }
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
