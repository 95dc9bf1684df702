// Estimated errors, gates and mixes of flat frames against their formulas in double precision, on values at the ends of what
// files hold.
#include <gtest/gtest.h>

#include "flat/finite.h"
#include "flat/level.h"
#include "flat/progressive.h"
#include "tests/reference/bilateral.h"
#include "tests/reference/flat_gate.h"
#include "tests/stress/flat_scenes.h"

namespace fathom::flat {
namespace {

using reference::boxDenoiser;
using stress::forScenes;
using stress::record;
using stress::Scene;
using stress::valueAt;

// Variances of means from two halves, and what they are called.
TEST(StressProgressive, NoiseIsReadAsItsFormulasHaveIt) {
  constexpr double kBound = 1e-6;
  double worst = 0;
  forScenes([&](const Scene& scene) {
    const Image& image = scene.noisy;
    const bool told = image.find("variance.R");
    for (size_t i = 0; i < scene.pixels(); ++i) {
      if (scene.noise.pixel[i] != PixelNoise::Known) continue;
      const double n0 = valueAt(image, "half0.samples", i), n1 = valueAt(image, "half1.samples", i), n = n0 + n1;
      for (size_t c = 0; c < 3; ++c) {
        const double a = valueAt(image, std::string("half0.") + kRgbNames[c], i),
                     b = valueAt(image, std::string("half1.") + kRgbNames[c], i);
        // The difference of two floats is exact where they are alike.
        const double d = double(float(a - b));
        const double expected = told               ? valueAt(image, std::string("variance.") + kRgbNames[c], i)
                                : n0 > 0 && n1 > 0 ? n0 / n * (n1 / n) * d * d
                                                   : 0;
        worst = std::max(worst, std::fabs(double(scene.noise.variance[c][i]) - expected) / (expected + 1e-37));
      }
    }
  });
  record("noise of flat frames", "values, halves of any counts", worst, kBound);
  EXPECT_LT(worst, kBound);
}

// SURE from a response, relative to the sum of the absolute values of its terms.
TEST(StressProgressive, TheErrorEstimateEqualsItsFormula) {
  constexpr double kBound = 1e-6;
  double worst = 0;
  forScenes([&](const Scene& scene) {
    NoiseResponse response;
    stress::Draw draw(3);
    for (size_t c = 0; c < 3; ++c) {
      response.covariance[c] = Buffer<float>(scene.pixels());
      response.spread[c] = Buffer<float>(scene.pixels());
      for (size_t i = 0; i < scene.pixels(); ++i) {
        response.covariance[c][i] = scene.noise.variance[c][i] * float(draw.uniform(-0.1, 1));
        response.spread[c][i] = scene.noise.variance[c][i] * float(draw.uniform());
      }
    }
    NoiseResponse copy{{response.covariance[0].copy(), response.covariance[1].copy(), response.covariance[2].copy()},
                       {response.spread[0].copy(), response.spread[1].copy(), response.spread[2].copy()}};
    const ErrorEstimate found = estimateError(scene.noisy, scene.noise, scene.denoised, std::move(copy));
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < scene.pixels(); ++i) {
        const double r =
            double(float(valueAt(scene.denoised, kRgbNames[c], i) - valueAt(scene.noisy, kRgbNames[c], i)));
        const double v = double(scene.noise.variance[c][i]), f = double(response.covariance[c][i]);
        const bool known = scene.noise.pixel[i] == PixelNoise::Known;
        const double error = r * r - v + 2 * (known ? f : 0), all = r * r + v + 2 * std::fabs(f);
        const bool told = scene.noise.pixel[i] != PixelNoise::Unknown && std::fabs(error) <= 1e15;
        if (std::fabs(std::fabs(error) / 1e15 - 1) < 1e-5) continue;  // on the edge of what counts as finite
        const double expected = told ? error : double(response.spread[c][i]);
        worst = std::max(worst, std::fabs(double(found.error[c][i]) - expected) / (all + 1e-36));
      }
  });
  record("SURE", "values, variance 0 and huge, 0 to 10,000 samples", worst, kBound);
  EXPECT_LT(worst, kBound);
}

Padded padded(const Box& window, const Buffer<float>& values, double largest) {
  Padded result(window.width(), window.height(), 5);
  for (int y = 0; y < window.height(); ++y)
    for (int x = 0; x < window.width(); ++x) {
      const float v = values[size_t(y * window.width() + x)];
      result.row(y)[x] = std::fabs(double(v)) <= largest ? v : 0;
    }
  result.extend();
  return result;
}

// The map from SURE, spread and variance, by flat/error_map.h. Of a variance of a mean what is beyond 1e15 counts as that.
TEST(StressProgressive, TheErrorMapEqualsItsTwin) {
  constexpr double kBound = 1e-4;
  double worst = 0;
  forScenes([&](const Scene& scene) {
    const Box& window = scene.noisy.dataWindow;
    const ErrorEstimate e = estimateError(scene.noisy, scene.noise, scene.denoised, boxDenoiser());
    const ErrorMap map = mapErrors(e, scene.noise, scene.denoised);
    LevelSum all;
    const auto sizeOf = [&](size_t c, size_t i) {
      return std::fabs(e.error[c][i]) + e.spread[c][i] + scene.noise.variance[c][i];
    };
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < scene.pixels(); ++i) all.add(double(sizeOf(c, i)));
    const double limit = std::min(all.limit(kAbsurd), 1e15);
    double sure = 0, spread = 0, variance = 0;
    std::vector<Padded> guide;
    for (size_t c = 0; c < 3; ++c) {
      guide.push_back(padded(window, scene.denoised.get(kRgbNames[c]).values, 1e15));
      for (size_t i = 0; i < scene.pixels(); ++i) {
        if (!(double(sizeOf(c, i)) < limit)) continue;
        sure += double(e.error[c][i]);
        spread += double(e.spread[c][i]);
        variance += double(scene.noise.variance[c][i]);
      }
    }
    const double ratio = spread > 0 ? std::clamp(sure / spread, 1.0, 100.0) : 1;
    const double rest = variance > 0 ? std::max(0.0, sure - ratio * spread) / variance : 0;
    BilateralParams params{.radius = 5, .sigma = 2.5f, .sharpness = 2};
    params.floor = 4e-4f * scene.noise.level * scene.noise.level;
    for (size_t c = 0; c < 3; ++c) {
      Buffer<float> squares(scene.pixels());
      for (size_t i = 0; i < squares.size(); ++i) squares[i] = scene.noise.variance[c][i] * scene.noise.variance[c][i];
      std::vector<Padded> in, square, sizes;
      for (const auto* values : {&e.error[c], &e.spread[c], &scene.noise.variance[c], &e.covariance[c]}) {
        in.push_back(padded(window, *values, 1e30));
        sizes.push_back(padded(window, *values, 1e30));
        for (int y = 0; y < window.height(); ++y)
          for (int x = 0; x < window.width(); ++x) sizes.back().row(y)[x] = std::fabs(sizes.back().row(y)[x]);
        sizes.back().extend();
      }
      square.push_back(padded(window, squares, 2e30));
      for (int y = 0; y < window.height(); ++y)
        for (int x = 0; x < window.width(); ++x) {
          const auto mean = reference::bilateral(x, y, params, guide, in),
                     size = reference::bilateral(x, y, params, guide, sizes);
          const double squared = reference::bilateral(x, y, params, guide, square, true)[0];
          const double n = squared >= FLT_MIN ? 4 * squared : 0;
          const double p = ratio * mean[1] + rest * mean[2], weight = p * p + n;
          const double error =
              std::max(weight > 0 ? (mean[0] * p * p + p * n) / weight : std::max(mean[0], 0.0), 0.5 * mean[1]);
          const size_t i = size_t(y * window.width() + x);
          const double least = 1e-12 * double(scene.noise.level) * double(scene.noise.level);
          worst = std::max(worst, std::fabs(double(map.error[c][i]) - error) / (size[0] + size[1] + size[2] + least));
          worst = std::max(worst, std::fabs(double(map.variance[c][i]) - mean[2]) / (mean[2] + least));
          ASSERT_TRUE(map.error[c][i] >= 0 && std::isfinite(map.error[c][i]));
        }
    }
  });
  record("error map", "values, variance 0 and huge, 0 to 10,000 samples", worst, kBound);
  EXPECT_LT(worst, kBound);
}

// Pixels of which all is known, as the twin takes them.
TEST(StressProgressive, TheGateOnPixelsEqualsItsTwin) {
  constexpr double kBound = 1e-4;
  double worst = 0;
  forScenes([&](const Scene& whole) {
    Scene scene(whole.noisy.dataWindow.width(), whole.noisy.dataWindow.height(), 5, 6e4f);
    stress::Draw draw(unsigned(whole.pixels()));
    for (size_t i = 0; i < scene.pixels(); ++i) {
      scene.noise.pixel[i] = PixelNoise::Known;
      scene.noise.samples[i] = draw.of({1, 2, 64, 10000});
      for (size_t c = 0; c < 3; ++c) {
        const double x = valueAt(whole.noisy, kRgbNames[c], i);
        scene.noisy.find(kRgbNames[c])->values[i] = finiteOrZero(float(x));
        scene.noise.variance[c][i] = draw.below(5) ? float(std::min(x * x * draw.power(1e-6, 1), 1e15)) : 0;
      }
    }
    scene.denoised = reference::boxMean(scene.noisy);
    scene.noise.level = whole.noise.level;
    const Buffer<float> k = gate(scene.noisy, scene.noise, scene.denoised);
    const int width = scene.noisy.dataWindow.width();
    for (size_t i = 0; i < scene.pixels(); ++i) {
      const double expected =
          reference::gate(scene.noisy, scene.noise, scene.denoised, int(i) % width, int(i) / width, 2.5);
      ASSERT_TRUE(k[i] >= 0 && k[i] <= 1);
      for (size_t c = 0; c < 3; ++c) {
        const double x = valueAt(scene.noisy, kRgbNames[c], i), f = valueAt(scene.denoised, kRgbNames[c], i);
        const double size = std::fabs(x) + std::fabs(f) + 1e-6 * double(scene.noise.level);
        worst = std::max(worst, std::fabs(double(k[i]) - expected) * std::fabs(x - f) / size);
      }
    }
  });
  record("gate on pixels", "values, variance 0 and huge, 1 to 10,000 samples", worst, kBound);
  EXPECT_LT(worst, kBound);
}

// Equations 8 and 9 in double precision.
TEST(StressProgressive, TheMixEqualsItsFormula) {
  constexpr double kBound = 1e-5;
  double worst = 0, worstError = 0;
  forScenes([&](const Scene& scene) {
    const ErrorEstimate e = estimateError(scene.noisy, scene.noise, scene.denoised, boxDenoiser());
    const ErrorMap map = mapErrors(e, scene.noise, scene.denoised);
    const Buffer<float> k = gate(scene.noisy, scene.noise, scene.denoised);
    const Image result = mix(scene.noisy, scene.noise, scene.denoised, map, k);
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < scene.pixels(); ++i) {
        const double x = valueAt(scene.noisy, kRgbNames[c], i), y = valueAt(scene.denoised, kRgbNames[c], i);
        const double found = valueAt(result, kRgbNames[c], i);
        ASSERT_TRUE(std::isfinite(found));
        if (scene.noise.pixel[i] == PixelNoise::Converged) {
          ASSERT_EQ(found, x);
          continue;
        }
        if (scene.noise.pixel[i] == PixelNoise::Unknown || std::fabs(y) > 1e15) continue;
        const double error = map.error[c][i], v = map.variance[c][i], f = map.covariance[c][i];
        const double n = scene.noise.samples[i], doubt = n > 1 ? (n + 11) / (n - 1) : 1;
        const double s = doubt * std::max(v, double(scene.noise.variance[c][i]));
        const double ours = std::max(s - f, 0.0), theirs = std::max(error - f, 0.0);
        const double a = std::min(theirs > 0 ? ours / (ours + theirs) : 1.0, 1 - double(k[i]) / doubt);
        worst = std::max(worst, std::fabs(found - (x + a * (y - x))) / (std::fabs(x) + std::fabs(y) + 1e-36));
        const double told = std::max(0.0, (1 - a) * (1 - a) * v + a * a * error + 2 * a * (1 - a) * f);
        worstError = std::max(worstError, std::fabs(valueAt(result, std::string("error.") + kRgbNames[c], i) - told) /
                                              (v + error + 1e-36));
      }
  });
  record("progressive mix", "values, variance 0 and huge, 0 to 10,000 samples", worst, kBound);
  record("progressive mix, its error", "values, variance 0 and huge, 0 to 10,000 samples", worstError, kBound);
  EXPECT_LT(worst, kBound);
  EXPECT_LT(worstError, kBound);
}

}  // namespace
}  // namespace fathom::flat
