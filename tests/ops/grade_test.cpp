// Grading: what flattening sees is the same grade, depths weigh it, and what is not graded stays.
#include "deep/ops/grade.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/volume.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;

constexpr float kInf = std::numeric_limits<float>::infinity();

// One sample in double precision, straight from the definition; colours not premultiplied.
std::array<double, 3> slowGrade(const GradeParams& params, std::array<double, 3> colour, double alpha, double weight) {
  std::array<double, 3> graded{};
  for (size_t c = 0; c < 3; ++c) {
    graded[c] = colour[c] / alpha * double(params.gain[c]) + double(params.offset[c]);
    if (graded[c] > 0) graded[c] = std::pow(graded[c], 1 / double(params.gamma[c]));
  }
  const double grey = 0.2126 * graded[0] + 0.7152 * graded[1] + 0.0722 * graded[2];
  for (size_t c = 0; c < 3; ++c) {
    graded[c] = grey + double(params.saturation) * (graded[c] - grey);
    graded[c] = colour[c] + weight * (graded[c] * alpha - colour[c]);
  }
  return graded;
}

TEST(Grade, IsTheDefinition) {
  GradeParams params{.gain = {1.5f, 0.5f, 2}, .offset = {0.1f, -0.3f, 0}, .gamma = {2.2f, 0.7f, 1}, .saturation = 0.4f};
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const DeepImage image = randomSamples({.window = {0, 0, 40, 20}, .seed = seed, .volumes = seed % 2 == 0});
    const DeepImage graded = grade(image.copy(), params);
    for (size_t s = 0; s < image.samples(); ++s) {
      const auto expected =
          slowGrade(params, {image.get("R")[s], image.get("G")[s], image.get("B")[s]}, image.get("A")[s], 1);
      const char* names[] = {"R", "G", "B"};
      for (size_t c = 0; c < 3; ++c)
        ASSERT_NEAR(graded.get(names[c])[s], expected[c], 1e-5 * double(image.get("A")[s]))
            << names[c] << ", sample " << s << ", seed " << seed;
    }
  }
}

TEST(Grade, WithoutGammaIsThatOfTheFlattened) {
  const GradeParams params{.gain = {1.5f, 0.5f, 2}, .offset = {0.1f, -0.3f, 0}, .saturation = 1.3f};
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true, .odd = true, .sorted = false});
    const flat::Image before = flatten(image), after = flatten(grade(image.copy(), params));
    for (size_t i = 0; i < before.get("A").values.size(); ++i) {
      std::array<double, 3> linear{};
      for (size_t c = 0; c < 3; ++c)
        linear[c] = double(before.planes[c].values[i]) * double(params.gain[c]) +
                    double(before.get("A").values[i]) * double(params.offset[c]);
      const double grey = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
      for (size_t c = 0; c < 3; ++c)
        ASSERT_NEAR(after.planes[c].values[i], grey + 1.3 * (linear[c] - grey), 3e-5)
            << before.planes[c].name << ", seed " << seed;
    }
  }
}

TEST(Grade, OfDefaultsIsTheImageAndOtherChannelsStay) {
  const DeepImage image = randomSamples({.seed = 3, .volumes = true});
  EXPECT_EQ(reference::difference(grade(image.copy(), {}), image), "");
  const DeepImage graded = grade(image.copy(), {.channels = {"G"}, .gain = {5, 5, 5}});
  for (const Channel& channel : image.channels) {
    if (channel.name == "G") continue;
    DeepImage one = image.copyLayout(), other = image.copyLayout();
    one.channels.push_back({channel.name, channel.type, channel.values.copy(), channel.ids.copy()});
    const Channel& now = *graded.find(channel.name);
    other.channels.push_back({now.name, now.type, now.values.copy(), now.ids.copy()});
    EXPECT_EQ(reference::difference(one, other), "");
  }
}

TEST(Grade, OutsideOfTheDepthsPassesBitForBit) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true, .odd = true});
    EXPECT_EQ(reference::difference(grade(image.copy(), {.gain = {9, 9, 9}, .near = 2, .far = 2}), image), "");
    const GradeParams params{.gain = {2, 2, 2}, .near = 2, .far = 4};
    const DeepImage graded = grade(image.copy(), params);
    for (size_t s = 0; s < image.samples(); ++s) {
      const double middle = usableRange(image.get("Z")[s], image.get("ZBack")[s]).middle();
      const float red = image.get("R")[s], inside = 2 * finiteOrZero(red), now = graded.get("R")[s];
      if (middle >= 2 && middle < 4)
        ASSERT_EQ(now, inside) << "seed " << seed;
      else
        ASSERT_TRUE(now == red || (std::isnan(now) && std::isnan(red))) << "seed " << seed;
    }
  }
}

// The factor that a gain of 3 becomes at a depth.
float gainAt(float z, GradeParams params, float zBack = 0) {
  params.gain = {3, 3, 3};
  params.channels = {"R", "B"};
  const DeepImage image = reference::makeDeep({{{.z = z, .zBack = zBack, .alpha = 0.5f, .colour = 0.25f}}}, 1);
  return grade(image.copy(), params).get("R")[0] / 0.25f;
}

TEST(Grade, FallsOffSmoothlyOverTheWidths) {
  const GradeParams params{.near = 10, .far = 20, .nearWidth = 2, .farWidth = 4};
  EXPECT_EQ(gainAt(7.9f, params), 1);
  EXPECT_EQ(gainAt(8, params), 1);
  EXPECT_EQ(gainAt(9, params), 2);
  EXPECT_EQ(gainAt(10, params), 3);
  EXPECT_EQ(gainAt(20, params), 3);
  EXPECT_FLOAT_EQ(gainAt(21, params), 1 + 2 * (0.5625f * 1.5f));
  EXPECT_EQ(gainAt(22, params), 2);
  EXPECT_EQ(gainAt(24, params), 1);
  EXPECT_EQ(gainAt(4, params, 14), 2) << "a volume weighs as its middle";
  float before = 3;
  for (int i = 0; i <= 32; ++i) {
    const float now = gainAt(20 + float(i) / 8, params);
    EXPECT_LE(now, before);
    EXPECT_LT(before - now, 0.1f);
    before = now;
  }
  EXPECT_EQ(gainAt(kInf, {}), 3);
  EXPECT_EQ(gainAt(std::numeric_limits<float>::quiet_NaN(), {.far = 5}), 1);
  EXPECT_EQ(gainAt(1, {.far = -kInf}), 1);
}

TEST(Grade, EmissionHasNoOffsetAndNoGamma) {
  const DeepImage image = reference::makeDeep({{{.z = 1, .alpha = 0, .colour = 0.25f},
                                                {.z = 2, .alpha = 0.5f, .colour = -0.5f},
                                                {.z = 3, .alpha = 1e-38f, .colour = 1e10f}}},
                                              1);
  const DeepImage graded =
      grade(image.copy(), {.channels = {"R"}, .gain = {3, 3, 3}, .offset = {1, 1, 1}, .gamma = {0.1f, 1, 1}});
  EXPECT_EQ(graded.get("R")[0], 0.75f);
  EXPECT_EQ(graded.get("R")[1], -1.0f) << "negative values pass gamma";
  EXPECT_EQ(graded.get("R")[2], kLargest) << "and it makes nothing infinite";
}

// With one channel too large, be it by gain, in floats or beyond them, the others are still what saturation makes of it.
TEST(Grade, ResultsEndBeforeTheyAreMixed) {
  const double most = double(kLargest), grey = 0.2126 * most;
  struct Case {
    float red;
    GradeParams params;
  };
  for (auto& [red, params] : {Case{1e10f, {.gain = {1e30f, 1, 1}}}, Case{1e3f, {.gamma = {0.1f, 1, 1}}},
                              Case{1e10f, {.gamma = {0.1f, 1, 1}}}}) {
    DeepImage image = reference::makeDeep({{{.z = 1, .alpha = 1, .colour = red}}}, 1);
    image.get("B")[0] = 0;
    image.add("G", PixelType::Float).values.fill(0);
    GradeParams half = params, thousands = params;
    half.saturation = 0.5f;
    thousands.saturation = 1e4f;
    const DeepImage graded = grade(image.copy(), half), limited = grade(image.copy(), thousands);
    EXPECT_NEAR(graded.get("R")[0] / most, (most + grey) / 2 / most, 1e-6);
    EXPECT_NEAR(graded.get("G")[0] / most, grey / 2 / most, 1e-6);
    EXPECT_NEAR(graded.get("B")[0] / most, grey / 2 / most, 1e-6);
    EXPECT_EQ(limited.get("R")[0], kLargest);
    EXPECT_EQ(limited.get("G")[0], -kLargest);
  }
}

// A step of the quotient is a fifth of it; raised to a tenth, that would be a fiftieth.
TEST(Grade, HardlyAnyLightIsRaisedInDouble) {
  const float red = 4 * std::numeric_limits<float>::denorm_min(), alpha = 0.9f;
  const DeepImage image = reference::makeDeep({{{.z = 1, .alpha = alpha, .colour = red}}}, 1);
  const double expected = std::pow(double(red) / double(alpha), 0.1) * double(alpha);
  EXPECT_NEAR(grade(image.copy(), {.channels = {"R"}, .gamma = {10, 1, 1}}).get("R")[0] / expected, 1, 1e-5);
}

TEST(Grade, WhatIsNoNumberIsNothingWhereItFadesToo) {
  const GradeParams params{.channels = {"R"}, .offset = {1, 1, 1}, .near = 10, .nearWidth = 2};
  for (const float odd : {kInf, std::numeric_limits<float>::quiet_NaN(), 1e20f}) {
    const DeepImage image = reference::makeDeep({{{.z = 9, .alpha = 0.5f, .colour = odd}}}, 1);
    EXPECT_EQ(grade(image.copy(), params).get("R")[0], 0.25f) << odd;
  }
  // No depth is so far away that its weight is none.
  const DeepImage nearest = reference::makeDeep({{{.z = -kInf, .zBack = -kInf, .alpha = 0.5f, .colour = 0.25f}}}, 1);
  EXPECT_EQ(grade(nearest.copy(), {.channels = {"R"}, .gain = {3, 3, 3}, .far = -kInf, .farWidth = 1}).get("R")[0],
            0.25f);
}

TEST(Grade, WorksOnLayersAndDropsWhatDescribedThem) {
  DeepImage image = randomSamples({.seed = 5});
  for (const char* name :
       {"diffuse.R", "diffuse.G", "diffuse.B", "variance.diffuse.R", "variance.R", "half0.diffuse.G", "samples"})
    image.add(name, PixelType::Float).values.fill(1);
  const DeepImage graded = grade(image.copy(), {.channels = {"diffuse"}, .gain = {2, 3, 4}, .saturation = 0});
  const float grey = 0.2126f * 2 + 0.7152f * 3 + 0.0722f * 4;
  for (const char* name : {"diffuse.R", "diffuse.G", "diffuse.B"})
    for (const float value : graded.get(name)) ASSERT_NEAR(value, grey, 1e-6);
  EXPECT_FALSE(graded.find("variance.diffuse.R") || graded.find("half0.diffuse.G"));
  EXPECT_TRUE(graded.find("variance.R") && graded.find("samples"));
}

TEST(Grade, TakesEmptyImagesAndRefusesWhatItCannot) {
  const DeepImage image = randomSamples({.seed = 1}), none = rows(image, 4, 4);
  EXPECT_EQ(grade(none.copy(), {.gain = {2, 2, 2}}).samples(), 0u);
  EXPECT_THROW(grade(image.copy(), {.channels = {"specular"}}), Error);
  EXPECT_THROW(grade(image.copy(), {.channels = {"Z"}}), Error);
  EXPECT_THROW(grade(image.copy(), {.channels = {"id"}}), Error);
  EXPECT_THROW(grade(image.copy(), {.gamma = {1, 0, 1}}), Error);
  EXPECT_THROW(grade(image.copy(), {.channels = {"R", "G"}, .saturation = 2}), Error);
}

}  // namespace
}  // namespace fathom::deep
