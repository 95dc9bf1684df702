// One bright value in a frame must not change what constants scale with, and so all of the result.
#include <gtest/gtest.h>

#include "deep/denoise.h"
#include "flat/level.h"
#include "flat/noise.h"
#include "tests/reference/noisy_flat.h"
#include "tests/reference/rendered_frame.h"
#include "tests/stress/extreme_noisy.h"
#include "tests/stress/record.h"

namespace fathom::deep {
namespace {

using stress::record;

TEST(StressLevel, OneBrightBinChangesNothingOutOfReach) {
  constexpr double kBound = 1e-3;
  const DeepImage clean = reference::renderFrame({.width = 90, .height = 40}).noisy;
  const DenoisePlan plan = stress::planFor(clean);
  const DeepImage expected = denoise(clean.copy(), plan);
  const int halo = denoiseHalo(plan);
  double worst = 0;
  for (const float value : {1e5f, 1e9f, 9e14f, -9e14f, 1e20f, stress::kNan}) {
    DeepImage image = clean.copy();
    const size_t bin = size_t(image.offsets[20 * 90 + 80]);
    for (Channel& channel : image.channels)
      if (stress::factorOf(channel.name, 2) == 2) channel.values[bin] = value;
    const DenoisePlan own = stress::planFor(image);
    EXPECT_NEAR(own.level, plan.level, 2e-3f * plan.level) << value;
    const DeepImage out = denoise(std::move(image), own);
    for (const char* name : {"R", "G", "B"})
      for (size_t p = 0; p < clean.pixels(); ++p) {
        if (int(p % 90) > 80 - halo - 1) continue;
        for (uint64_t b = clean.offsets[p]; b < clean.offsets[p + 1]; ++b) {
          const double was = double(expected.get(name)[b]), alpha = double(clean.get("A")[b]);
          const double far = std::fabs(double(out.get(name)[b]) - was) / std::max(was, 0.005 * alpha);
          ASSERT_LT(far, kBound) << value << " in pixel " << p;
          worst = std::max(worst, far);
        }
      }
  }
  record("deep denoiser", "poison: what moves out of reach, by the frame's level", worst, kBound);
}

TEST(StressLevel, OfFlatFramesToo) {
  flat::Image image = reference::makeNoisyFlat(40, 30, 1).noisy;
  const float level = flat::noiseOf(image).level;
  for (const float value : {1e5f, 9e14f, -9e14f, 1e20f, stress::kNan}) {
    for (const char* name : flat::kRgbNames) image.find(name)->values[77] = value;
    EXPECT_NEAR(flat::noiseOf(image).level, level, 2e-3f * level) << value;
  }
}

float levelOf(const std::vector<float>& values) {
  flat::LevelSum sum;
  for (const float v : values) sum.add(double(v));
  return sum.result();
}

TEST(StressLevel, IsTheMeanOfWhatIsNotFarAbove) {
  EXPECT_EQ(levelOf({}), 0.5f);
  EXPECT_EQ(levelOf({0, 0, 0, 0}), 0.5f);
  EXPECT_FLOAT_EQ(levelOf({1, 2, 3}), 2);
  EXPECT_FLOAT_EQ(levelOf({0, 0, 0, 8}), 2);  // a light in the dark is all the light there is
  EXPECT_FLOAT_EQ(levelOf({1, 1, 1, 1, 900}), 904 / 5.0f);
  EXPECT_FLOAT_EQ(levelOf({1, 1, 1, 1, 3000}), 1);
  EXPECT_FLOAT_EQ(levelOf({1, 1, 1, 1, 3000, 3000, 9e14f}), 1);
  EXPECT_FLOAT_EQ(levelOf({1, 1, 1, 1, 3000, -9e14f, 9e14f}), 1);
  EXPECT_FLOAT_EQ(levelOf({1, 1, 1, 1, 4000, 4000, 4000, 4000}), 16004 / 8.0f);  // too many to leave out
  EXPECT_FLOAT_EQ(levelOf({1, stress::kNan, stress::kInfinity, 1e16f}), 1);
  EXPECT_FLOAT_EQ(levelOf({1e-14f, 1e-14f}), 1e-14f);
  EXPECT_EQ(levelOf({1e-42f, 1e-42f}), 0.5f);
  EXPECT_FLOAT_EQ(levelOf({1, 1, 1, 1, 1023}), 1027 / 5.0f);
  EXPECT_FLOAT_EQ(levelOf({1, 1, 1, 1, 1024}), 1);  // the first power of two above a thousand times the others
  std::vector<float> sun(1000, 0.5f);
  std::fill_n(sun.begin(), 9, 1e5f);
  EXPECT_FLOAT_EQ(levelOf(sun), 0.5f);
  std::fill_n(sun.begin(), 10, 1e5f);
  EXPECT_FLOAT_EQ(levelOf(sun), 0.5f);
  std::fill_n(sun.begin(), 11, 1e5f);
  EXPECT_NEAR(levelOf(sun), 1100.5, 0.1);
  std::fill_n(sun.begin(), 20, 1e5f);
  EXPECT_NEAR(levelOf(sun), 2000, 1);
}

}  // namespace
}  // namespace fathom::deep
