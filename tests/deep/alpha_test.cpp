#include "deep/alpha.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "base/error.h"
#include "tests/reference/deep_samples.h"

namespace fathom::deep {
namespace {

using reference::makeDeep;
using reference::Pixels;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

TEST(EffectiveAlpha, IsTheShareOfCameraSamples) {
  // The k-th of n samples has alpha 1 / (n - k): each is 1 / n of the pixel.
  Pixels pixels;
  for (int n = 1; n <= 64; ++n) {
    pixels.emplace_back();
    for (int k = 0; k < n; ++k) pixels.back().push_back({.z = float(k + 1), .alpha = float(1.0 / (n - k))});
  }
  const DeepImage image = makeDeep(pixels, 8, false);
  const Buffer<float> alpha = effectiveAlpha(image);
  for (size_t n = 1; n <= 64; ++n)
    for (size_t i = image.offsets[n - 1]; i < image.offsets[n]; ++i)
      EXPECT_NEAR(alpha[i] * float(n), 1, 2e-6) << i - image.offsets[n - 1] << " of " << n;
}

TEST(EffectiveAlpha, DoesNotCancelBehindNearlyOpaqueSamples) {
  const float nearly = 1 - 5.9604645e-8f;
  const Buffer<float> alpha = effectiveAlpha(makeDeep({{{.alpha = nearly}, {.alpha = nearly}, {.alpha = 0.5f}}}, 1));
  EXPECT_EQ(alpha[0], nearly);
  EXPECT_FLOAT_EQ(alpha[1], 5.9604645e-8f * nearly);
  EXPECT_FLOAT_EQ(alpha[2], 5.9604645e-8f * 5.9604645e-8f * 0.5f);
}

TEST(EffectiveAlpha, SumsToWhatTheSamplesHide) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(0, 1);
  Pixels pixels(100);
  for (size_t p = 0; p < pixels.size(); ++p)
    for (size_t i = 0; i < p % 20; ++i) pixels[p].push_back({.alpha = uniform(random)});
  const DeepImage image = makeDeep(pixels, 10);
  const Buffer<float> alpha = effectiveAlpha(image);
  for (size_t p = 0; p < pixels.size(); ++p) {
    double sum = 0, passed = 1;
    for (size_t i = 0; i < pixels[p].size(); ++i) {
      sum += double(alpha[image.offsets[p] + i]);
      passed *= 1 - double(pixels[p][i].alpha);
    }
    EXPECT_NEAR(sum, 1 - passed, 1e-6);
  }
}

TEST(EffectiveAlpha, TakesAnyAlpha) {
  const Buffer<float> alpha =
      effectiveAlpha(makeDeep({{{.alpha = kNan}, {.alpha = -2}, {.alpha = 0.5f}, {.alpha = 7}, {.alpha = 1}}}, 1));
  EXPECT_EQ(std::vector<float>(alpha.begin(), alpha.end()), (std::vector<float>{0, 0, 0.5f, 0.5f, 0}));
}

TEST(EffectiveAlpha, NeedsAlpha) {
  DeepImage image = makeDeep({{{.alpha = 1}}}, 1);
  image.erase("A");
  EXPECT_THROW(effectiveAlpha(image), Error);
}

}  // namespace
}  // namespace fathom::deep
