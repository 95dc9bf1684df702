// The mix of two estimates: its kernel against the twin, and that it takes what errs less.
#include "flat/mix.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/reference/mix.h"
#include "tests/reference/simd_targets.h"

namespace fathom::flat {
namespace {

TEST(MixKernel, EqualsItsTwin) {
  forSimdTargets([] {
    std::mt19937 random(3);
    for (size_t count = 0; count <= 49; ++count)
      for (const float noise : {0.0f, 1e-4f, 0.1f})
        for (const float prior : {0.0f, 0.4f, 1.0f}) {
          const auto all = reference::randomNeighbours(count, noise, random);
          MixNeighbours neighbours;
          for (const auto& [sample, reach] : all) neighbours.add(sample, reach);
          MixSample here = {};
          if (count > 0) here = all[count / 2].sample;
          const MixParams params{prior, 5};
          ASSERT_NEAR(mixShare(here, neighbours, params, 1e-4f), reference::mixShare(here, all, params, 1e-4), 2e-4)
              << count << " neighbours, noise " << noise << ", prior " << prior;
        }
  });
}

// A truth, two estimates that err by waves of their own, and a noisy render of it.
struct Scene {
  Image noisy, truth, first, second;
  Noise noise;

  Scene(int width, int height, float firstError, float secondError, float sigma) {
    const Box box{3, -2, 3 + width, -2 + height};
    std::mt19937 random(5);
    std::normal_distribution<float> normal;
    for (Image* image : {&noisy, &truth, &first, &second}) {
      image->dataWindow = image->displayWindow = box;
      for (const char* name : kRgbNames) image->add(name);
    }
    for (const char* name : kRgbNames) noisy.add(std::string("variance.") + name, sigma * sigma);
    noisy.add("samples", 16);
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < box.area(); ++i) {
        const float x = float(i % size_t(width)), y = float(i / size_t(width));
        const float value = 0.5f + 0.1f * float(c);
        truth.planes[c].values[i] = value;
        first.planes[c].values[i] = value + firstError * std::sin(0.4f * x + 0.9f * float(c));
        second.planes[c].values[i] = value + secondError * std::cos(0.5f * y);
        noisy.planes[c].values[i] = value + sigma * normal(random);
      }
    noise = noiseOf(noisy);
  }

  double error(const Image& image) const {
    double sum = 0;
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < truth.planes[c].values.size(); ++i) {
        const double e = double(image.planes[c].values[i] - truth.planes[c].values[i]);
        sum += e * e;
      }
    return sum;
  }
};

TEST(Mix, IsBetterThanBothWhereTheyErrAlike) {
  const Scene scene(40, 33, 0.05f, 0.05f, 0.1f);
  const double mixedError = scene.error(mixed(scene.noisy, scene.noise, scene.first, scene.second));
  EXPECT_LT(mixedError, 0.6 * scene.error(scene.first));
  EXPECT_LT(mixedError, 0.6 * scene.error(scene.second));
}

TEST(Mix, TakesTheBetterOneWhereTheOtherIsFarOff) {
  for (const bool firstIsBad : {true, false}) {
    const Scene scene(40, 33, firstIsBad ? 0.3f : 0.02f, firstIsBad ? 0.02f : 0.3f, 0.05f);
    const Image& good = firstIsBad ? scene.second : scene.first;
    const Image& bad = firstIsBad ? scene.first : scene.second;
    const double error = scene.error(mixed(scene.noisy, scene.noise, scene.first, scene.second));
    EXPECT_LT(error, 0.08 * scene.error(bad));
    EXPECT_LT(error, 4 * scene.error(good));
  }
}

TEST(Mix, ScalesWithTheLight) {
  const Scene scene(17, 9, 0.05f, 0.08f, 0.1f);
  const Image expected = mixed(scene.noisy, scene.noise, scene.first, scene.second);
  for (const float scale : {0x1p-20f, 0x1p20f}) {
    const auto scaled = [&](const Image& image) {
      Image result = image.copy();
      for (Plane& plane : result.planes)
        for (float& v : plane.values)
          v *= plane.name == "samples" ? 1 : plane.name.starts_with("variance.") ? scale * scale : scale;
      return result;
    };
    const Image noisy = scaled(scene.noisy);
    const Image result = mixed(noisy, noiseOf(noisy), scaled(scene.first), scaled(scene.second));
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < result.planes[c].values.size(); ++i)
        ASSERT_NEAR(result.planes[c].values[i] / scale, expected.planes[c].values[i], 1e-5) << scale;
  }
}

TEST(Mix, TakesWhatIsFinite) {
  Scene scene(9, 7, 0.05f, 0.05f, 0.1f);
  scene.first.planes[1].values[10] = std::numeric_limits<float>::quiet_NaN();
  scene.second.planes[2].values[30] = std::numeric_limits<float>::infinity();
  scene.noisy.planes[0].values[20] = std::numeric_limits<float>::quiet_NaN();
  const Image result = mixed(scene.noisy, noiseOf(scene.noisy), scene.first, scene.second);
  for (size_t c = 0; c < 3; ++c) {
    for (const float v : result.planes[c].values) ASSERT_TRUE(std::isfinite(v));
    EXPECT_EQ(result.planes[c].values[10], scene.second.planes[c].values[10]);
    EXPECT_EQ(result.planes[c].values[30], scene.first.planes[c].values[30]);
  }
}

TEST(Mix, SmallImages) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 9}, {11, 1}, {3, 2}}) {
    const Scene scene(width, height, 0.1f, 0.1f, 0.1f);
    const Image result = mixed(scene.noisy, scene.noise, scene.first, scene.second);
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < result.planes[c].values.size(); ++i) {
        const float a = scene.first.planes[c].values[i], b = scene.second.planes[c].values[i];
        ASSERT_GE(result.planes[c].values[i], std::min(a, b) - 1e-6f);
        ASSERT_LE(result.planes[c].values[i], std::max(a, b) + 1e-6f);
      }
  }
}

}  // namespace
}  // namespace fathom::flat
