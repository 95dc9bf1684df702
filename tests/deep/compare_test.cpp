// Errors of deep images in closed form, and the laws of their parts.
#include "deep/compare.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "base/error.h"
#include "deep/clip.h"
#include "deep/flatten.h"
#include "tests/reference/deep_samples.h"

namespace fathom::deep {
namespace {

using reference::Pixels;
using ::testing::HasSubstr;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// R, G and B alike, so that the mean over channels is that of one.
DeepImage makeGrey(const Pixels& pixels, int width) {
  DeepImage image = reference::makeDeep(pixels, width);
  for (const char* name : {"G", "B"})
    std::ranges::copy(std::as_const(image).get("R"), image.add(name, PixelType::Float).values.begin());
  return image;
}

void fill(DeepImage& image, const char* name, const std::vector<float>& values) {
  std::ranges::copy(values, image.add(name, PixelType::Float).values.begin());
}

DeepImage makeRandom(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit;
  Pixels pixels(40);
  for (auto& pixel : pixels) {
    float z = unit(random);
    for (int n = int(random() % 5); n > 0; --n) {
      const float length = random() % 2 ? unit(random) : 0, alpha = random() % 3 ? unit(random) : 1;
      pixel.push_back({z, z + length, alpha, alpha * unit(random), 0});
      z += length + 0.1f + unit(random);
    }
  }
  return makeGrey(pixels, 8);
}

std::string errorOf(const DeepImage& image, const DeepImage& reference, const DeepMetricParams& params = {}) {
  try {
    compare(image, reference, params);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

double relative(double a, double r) {
  return (a - r) * (a - r) / (r * r + 0.01);
}

TEST(DeepCompare, EqualImagesHaveNoError) {
  const DeepImage image = makeRandom(1);
  const DeepMetrics m = compare(image, image, {.clips = {1, 2}});
  EXPECT_EQ(m.bins.relMse, 0);
  EXPECT_EQ(m.bins.mse, 0);
  EXPECT_EQ(m.bins.leftOut, 0);
  EXPECT_EQ(m.bins.excluded, 0u);
  EXPECT_EQ(m.flattened.relMse, 0);
  ASSERT_EQ(m.clips.size(), 2u);
  EXPECT_EQ(m.clips[1].depth, 2);
  EXPECT_EQ(m.clips[1].front->relMse, 0);
  EXPECT_EQ(m.clips[1].behind->relMse, 0);
}

// A pixel with a half-covered bin of colour 0.8 in front of an opaque one of 0.2; the image says 1.0 and 0.6.
TEST(DeepCompare, TwoBinsHaveClosedForms) {
  const DeepImage reference = makeGrey({{{1, 1, 0.5f, 0.4f, 0}, {3, 3, 1, 0.2f, 0}}}, 1);
  const DeepImage image = makeGrey({{{1, 1, 0.5f, 0.5f, 0}, {3, 3, 1, 0.6f, 0}}}, 1);
  const DeepMetrics m = compare(image, reference, {.clips = {3, 5}});
  EXPECT_NEAR(m.bins.relMse, 0.5 * relative(1, 0.8) + 0.5 * relative(0.6, 0.2), 1e-6);
  EXPECT_NEAR(m.bins.mse, 0.5 * 0.04 + 0.5 * 0.16, 1e-6);
  EXPECT_EQ(m.bins.bins, 2u);
  EXPECT_NEAR(m.flattened.relMse, relative(0.5 + 0.3, 0.4 + 0.1), 1e-6);
  EXPECT_NEAR(m.clips[0].front->relMse, relative(0.5, 0.4), 1e-6);
  EXPECT_NEAR(m.clips[0].behind->relMse, relative(0.3, 0.1), 1e-6);
  EXPECT_NEAR(m.clips[1].front->relMse, m.flattened.relMse, 1e-12);
  EXPECT_FALSE(m.clips[1].behind);
}

TEST(DeepCompare, WeightsAreEffectiveAlphas) {
  // The second bin shows a quarter, the third nothing: it is behind an opaque one.
  const DeepImage reference = makeGrey({{{1, 1, 0.75f, 0.75f, 0}, {2, 2, 1, 1, 0}, {3, 3, 1, 1, 0}}}, 1);
  const DeepImage image = makeGrey({{{1, 1, 0.75f, 0.75f, 0}, {2, 2, 1, 2, 0}, {3, 3, 1, 50, 0}}}, 1);
  const DeepMetrics m = compare(image, reference);
  EXPECT_NEAR(m.bins.relMse, 0.25 / 1.01, 1e-6);
  EXPECT_EQ(m.bins.bins, 2u);
}

TEST(DeepCompare, BinsOfFewReferenceSamplesAreLeftOutAndTheirShareTold) {
  DeepImage reference = makeGrey({{{1, 1, 0.5f, 0.4f, 0}, {3, 3, 1, 0.2f, 0}}}, 1);
  const DeepImage image = makeGrey({{{1, 1, 0.5f, 0.5f, 0}, {3, 3, 1, 0.6f, 0}}}, 1);
  fill(reference, "samples", {15, 16});
  const DeepMetrics m = compare(image, reference, {.clips = {2}});
  EXPECT_NEAR(m.bins.relMse, relative(0.6, 0.2), 1e-6);
  EXPECT_NEAR(m.bins.leftOut, 0.5, 1e-6);
  EXPECT_NEAR(m.clips[0].front->relMse, relative(0.5, 0.4), 1e-6);
  fill(reference, "samples", {1, kNan});
  EXPECT_THAT(errorOf(image, reference), HasSubstr("expected bins to compare"));
}

TEST(DeepCompare, BinsThatAreNotFiniteAreCountedAndHaveNoSay) {
  const DeepImage reference = makeGrey({{{1, 1, 0.5f, 0.4f, 0}, {3, 3, 1, 0.2f, 0}}, {{1, 1, 1, 0.5f, 0}}}, 2);
  for (const float broken : {kNan, kInfinity}) {
    const DeepImage image = makeGrey({{{1, 1, 0.5f, broken, 0}, {3, 3, 1, 0.6f, 0}}, {{1, 1, 1, 0.5f, 0}}}, 2);
    const DeepMetrics m = compare(image, reference);
    EXPECT_EQ(m.bins.excluded, 1u);
    EXPECT_EQ(m.bins.bins, 2u);
    EXPECT_NEAR(m.bins.relMse, 0.5 / 1.5 * relative(0.6, 0.2), 1e-6);
    EXPECT_EQ(m.flattened.excluded, 1u);
    EXPECT_EQ(m.flattened.relMse, 0);
  }
}

TEST(DeepCompare, TheReferencesOwnErrorIsToldAndTakenOff) {
  DeepImage reference = makeGrey({{{1, 1, 0.5f, 0.4f, 0}, {3, 3, 1, 0.2f, 0}}}, 1);
  const DeepImage image = makeGrey({{{1, 1, 0.5f, 0.5f, 0}, {3, 3, 1, 0.6f, 0}}}, 1);
  EXPECT_THAT(errorOf(image, reference, {.correct = true}), HasSubstr("variance"));
  EXPECT_FALSE(compare(image, reference).bins.ownRelMse);
  for (const char* name : {"variance.R", "variance.G", "variance.B"}) fill(reference, name, {0.01f, 0.02f});
  const DeepMetrics plain = compare(image, reference), corrected = compare(image, reference, {.correct = true});
  const double own = 0.5 * 0.01 / 0.65 + 0.5 * 0.02 / 0.05;
  EXPECT_NEAR(*plain.bins.ownRelMse, own, 1e-6);
  EXPECT_NEAR(corrected.bins.relMse, plain.bins.relMse - own, 1e-6);
  EXPECT_NEAR(corrected.bins.mse, plain.bins.mse - 0.015, 1e-6);
  // Flattened, each bin's variance counts with the square of its share.
  EXPECT_NEAR(*plain.flattened.ownRelMse, (0.25 * 0.01 + 0.25 * 0.02) / 0.26, 1e-6);
}

TEST(DeepCompare, DifferentBinsAreRefused) {
  const DeepImage reference = makeGrey({{{1, 1, 0.5f, 0.4f, 0}}, {{3, 3, 1, 0.2f, 0}}}, 2);
  EXPECT_THAT(errorOf(makeGrey({{{1, 1, 0.5f, 0.4f, 0}}, {}}, 2), reference),
              HasSubstr("pixel (4, -2): expected the 1 bins of the reference, found 0"));
  EXPECT_THAT(errorOf(makeGrey({{{1, 1, 0.5f, 0.4f, 0}}}, 1), reference),
              HasSubstr("expected the data window of the reference, (3, -2) to (4, -2), found (3, -2) to (3, -2)"));
}

TEST(DeepCompare, FlattenedIsWhatFlattenMakes) {
  const DeepImage image = makeRandom(2);
  const flat::Image seen = visiblePart(image), flattened = flatten(image);
  for (const char* name : {"R", "G", "B", "A"})
    for (size_t i = 0; i < image.pixels(); ++i)
      EXPECT_NEAR(seen.get(name).values[i], flattened.get(name).values[i], 1e-6f) << name << " of pixel " << i;
}

TEST(DeepCompare, PartsSumToTheWhole) {
  for (unsigned seed = 3; seed < 13; ++seed) {
    const DeepImage image = makeRandom(seed);
    const flat::Image whole = visiblePart(image);
    for (const float z : {0.5f, 1.2f, 2.0f, 3.3f}) {
      const flat::Image front = visiblePart(image, -kInfinity, z), behind = visiblePart(image, z);
      const flat::Image alone = flatten(clip(image, -kInfinity, z));
      for (const char* name : {"R", "A"})
        for (size_t i = 0; i < image.pixels(); ++i) {
          const float inFront = front.get(name).values[i];
          EXPECT_NEAR(inFront + behind.get(name).values[i], whole.get(name).values[i], 2e-6f)
              << name << i << " at " << z;
          EXPECT_NEAR(inFront, alone.get(name).values[i], 2e-6f) << "nothing attenuates what is in front";
        }
    }
  }
}

TEST(DeepCompare, TheMedianDepthHalvesTheAlpha) {
  EXPECT_EQ(medianDepth(makeGrey({{{1, 1, 0.5f, 0, 0}, {2, 2, 1, 0, 0}}}, 1)), 1);
  EXPECT_EQ(medianDepth(makeGrey({{{1, 1, 0.49f, 0, 0}, {2, 2, 1, 0, 0}}}, 1)), 2);
  EXPECT_EQ(medianDepth(makeGrey({{{1, 1, 0.25f, 0, 0}, {2, 2, 1, 0, 0}}, {{9, 9, 0, 0, 0}}}, 2)), 2);
  EXPECT_THROW(medianDepth(makeGrey({{{1, 1, 0, 0, 0}}}, 1)), Error);
}

TEST(DeepCompare, VariancesThatAreNoneCountAsNone) {
  DeepImage reference = makeGrey({{{1, 1, 0.5f, 0.4f, 0}, {3, 3, 1, 0.2f, 0}}}, 1);
  for (const float odd : {-0.5f, kNan, 1e20f, kInfinity}) {
    for (const char* name : {"variance.R", "variance.G", "variance.B"}) fill(reference, name, {odd, 0.02f});
    const DeepMetrics m = compare(reference, reference);
    EXPECT_NEAR(*m.bins.ownRelMse, 0.5 * 0.02 / 0.05, 1e-6) << odd;
    EXPECT_NEAR(*m.flattened.ownRelMse, 0.25 * 0.02 / 0.26, 1e-6) << odd;
  }
}

TEST(DeepCompare, VariancesOfOneColourAloneSayNothing) {
  DeepImage reference = makeGrey({{{1, 1, 0.5f, 0.4f, 0}, {3, 3, 1, 0.2f, 0}}}, 1);
  fill(reference, "variance.R", {0.01f, 0.02f});
  fill(reference, "variance.G", {0.01f, 0.02f});
  EXPECT_FALSE(compare(reference, reference).bins.ownRelMse);
  EXPECT_FALSE(compare(reference, reference).flattened.ownRelMse);
  EXPECT_EQ(visiblePart(reference).planes.size(), 4u);
  EXPECT_THAT(errorOf(reference, reference, {.correct = true}), HasSubstr("channel variance.R: expected"));
}

TEST(DeepCompare, PartsAreOfThePixelsThatHaveThem) {
  const DeepImage reference = makeGrey({{{1, 1, 0.5f, 0.4f, 0}, {3, 3, 1, 0.2f, 0}}, {{3, 3, 1, 0.2f, 0}}}, 2);
  const DeepImage image = makeGrey({{{1, 1, 0.5f, 0.5f, 0}, {3, 3, 1, 0.2f, 0}}, {{3, 3, 1, 0.2f, 0}}}, 2);
  const DeepMetrics m = compare(image, reference, {.clips = {2}});
  EXPECT_EQ(m.clips[0].front->pixels, 1u);
  EXPECT_NEAR(m.clips[0].front->relMse, relative(0.5, 0.4), 1e-6);
  EXPECT_EQ(m.clips[0].behind->pixels, 2u);
  EXPECT_NEAR(m.flattened.relMse, relative(0.6, 0.5) / 2, 1e-6);
}

TEST(DeepCompare, TheReferencesOwnErrorIsTakenOffPartsToo) {
  DeepImage reference = makeGrey({{{1, 1, 0.5f, 0.4f, 0}, {3, 3, 1, 0.2f, 0}}}, 1);
  const DeepImage image = makeGrey({{{1, 1, 0.5f, 0.5f, 0}, {3, 3, 1, 0.6f, 0}}}, 1);
  for (const char* name : {"variance.R", "variance.G", "variance.B"}) fill(reference, name, {0.01f, 0.02f});
  const DeepMetrics m = compare(image, reference, {.correct = true, .clips = {2}});
  EXPECT_NEAR(m.clips[0].front->relMse, relative(0.5, 0.4) - 0.25 * 0.01 / 0.17, 1e-6);
  EXPECT_NEAR(m.clips[0].behind->relMse, relative(0.3, 0.1) - 0.25 * 0.02 / 0.02, 1e-6);
  EXPECT_NEAR(m.flattened.relMse, relative(0.8, 0.5) - (0.25 * 0.01 + 0.25 * 0.02) / 0.26, 1e-6);
}

TEST(DeepCompare, WhatIsAtInfinityIsBehindEveryPlane) {
  for (const float far : {kInfinity, kNan}) {
    const DeepImage image = makeGrey({{{1, 1, 0.5f, 0.4f, 0}, {far, far, 1, 0.2f, 0}}}, 1);
    EXPECT_NEAR(visiblePart(image).get("R").values[0], 0.5f, 1e-6f);
    EXPECT_NEAR(visiblePart(image).get("A").values[0], 1, 1e-6f);
    EXPECT_NEAR(visiblePart(image, 1e30f).get("R").values[0], 0.1f, 1e-6f);
    EXPECT_NEAR(visiblePart(image, -kInfinity, 1e30f).get("R").values[0], 0.4f, 1e-6f);
  }
}

TEST(DeepCompare, AReferencesVariancesFollowFromThoseOfFewerSamples) {
  DeepImage reference = makeGrey({{{1, 1, 0.5f, 0.4f, 0}, {3, 3, 1, 0.2f, 0}}, {{2, 2, 1, 1, 0}}}, 2);
  DeepImage noisy = reference.copy();
  fill(noisy, "samples", {8, 16, 4});
  EXPECT_THROW(addOwnVariance(noisy, reference), Error);
  fill(reference, "samples", {32, 0, 64});
  EXPECT_THROW(addOwnVariance(noisy, reference), Error);
  for (const char* name : {"variance.R", "variance.G", "variance.B"}) fill(noisy, name, {0.04f, 0.02f, -1});
  fill(noisy, "variance.G", {kNan, 0.02f, 0.5f});
  addOwnVariance(noisy, reference);
  const auto variances = [&](const char* name) {
    const auto values = std::as_const(reference).get(name);
    return std::vector<float>(values.begin(), values.end());
  };
  // Of a fourth of the noise; of none where nothing tells; of none.
  EXPECT_EQ(variances("variance.R"), (std::vector<float>{0.01f, 0, 0}));
  EXPECT_EQ(variances("variance.G"), (std::vector<float>{0, 0, 0.03125f}));
  EXPECT_EQ(variances("variance.B"), (std::vector<float>{0.01f, 0, 0}));
  EXPECT_THROW(addOwnVariance(makeGrey({{{1, 1, 0.5f, 0.4f, 0}}, {}}, 2), reference), Error);
}

TEST(DeepCompare, TheMedianIsOfFiniteDepths) {
  for (const float far : {kInfinity, kNan})
    EXPECT_EQ(medianDepth(makeGrey({{{1, 1, 0.1f, 0, 0}, {2, 2, 0.2f, 0, 0}, {far, far, 1, 0, 0}}}, 1)), 2);
}

}  // namespace
}  // namespace fathom::deep
