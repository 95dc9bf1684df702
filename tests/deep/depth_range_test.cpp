#include "deep/depth_range.h"

#include <gtest/gtest.h>

#include <random>

namespace fathom::deep {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// The fade as the header tells it.
double fadeAt(const DepthRange& range, double z) {
  if (!(range.near < range.far)) return range.inverted ? 1 : 0;
  const double ramp = std::min(double(range.soft), (double(range.far) - double(range.near)) / 2);
  double fade = z >= double(range.near) && (z < double(range.far) || std::isinf(range.far)) ? 1 : 0;
  if (ramp > 0 && fade > 0 && std::isfinite(range.near)) fade = std::min(fade, (z - double(range.near)) / ramp);
  if (ramp > 0 && fade > 0 && std::isfinite(range.far)) fade = std::min(fade, (double(range.far) - z) / ramp);
  return range.inverted ? 1 - fade : fade;
}

// What lets pass a volume of which each of many thin slices is thinned by the fade in its middle.
double slowTransmittance(const DepthRange& range, const Range& volume, double alpha) {
  constexpr int kSlices = 20000;
  const double length = double(volume.zBack) - double(volume.z);
  double depth = 0;
  for (int i = 0; i < kSlices; ++i)
    depth += opticalDepth(alpha) / kSlices * fadeAt(range, double(volume.z) + length * (i + 0.5) / kSlices);
  return std::exp(-depth);
}

std::vector<Fragment> cut(const DepthRange& range, const Range& sample, double alpha) {
  std::array<Fragment, 2> room;
  const auto parts = RangeCut(range).cut(sample, alpha, room);
  return {parts.begin(), parts.end()};
}

double transmittance(const std::vector<Fragment>& parts) {
  double passed = 1;
  for (const Fragment& part : parts) passed *= 1 - part.alpha;
  return passed;
}

DepthRange randomRange(std::mt19937& random) {
  std::uniform_real_distribution<float> unit;
  DepthRange range{4 * unit(random) - 1, 4 * unit(random) - 1, random() % 3 ? unit(random) : 0, random() % 2 == 0};
  if (random() % 6 == 0) range.near = -kInfinity;
  if (random() % 6 == 0) range.far = kInfinity;
  return range;
}

TEST(DepthRange, AVolumeIsAMediumThatFades) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit;
  for (int i = 0; i < 300; ++i) {
    const DepthRange range = randomRange(random);
    const Range volume{unit(random), 1 + unit(random)};
    const double alpha = 0.999 * double(unit(random));
    const std::vector<Fragment> parts = cut(range, volume, alpha);
    EXPECT_NEAR(transmittance(parts), slowTransmittance(range, volume, alpha), 1e-3)
        << range.near << " to " << range.far << ", soft " << range.soft << ", inverted " << range.inverted;
    for (const Fragment& part : parts) {
      EXPECT_NEAR(part.weight, part.alpha / alpha, 1e-12);
      EXPECT_GE(part.range.z, volume.z);
      EXPECT_LE(part.range.zBack, volume.zBack);
    }
  }
}

TEST(DepthRange, WhatIsKeptAndWhatIsRemovedLetPassWhatTheWholeDoes) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> unit;
  for (int i = 0; i < 1000; ++i) {
    DepthRange range = randomRange(random), removed = range;
    removed.inverted = !range.inverted;
    const double alpha = double(unit(random));
    const Range volume{unit(random), 1 + unit(random)}, point{volume.z, volume.z};
    EXPECT_NEAR(transmittance(cut(range, volume, alpha)) * transmittance(cut(removed, volume, alpha)), 1 - alpha, 1e-9);
    double kept = 0;
    for (const auto& parts : {cut(range, point, alpha), cut(removed, point, alpha)})
      for (const Fragment& part : parts) kept += part.alpha;
    EXPECT_NEAR(kept, alpha, 1e-12);
  }
}

TEST(DepthRange, QuickAnswersAreTheExactOnes) {
  std::mt19937 random(3);
  const float depths[] = {-kInfinity, -1, 0, 0.25f, 0.5f, 1, 1.5f, 2, 3, kInfinity};
  const auto depth = [&] { return depths[random() % std::size(depths)]; };
  for (int i = 0; i < 20000; ++i) {
    const DepthRange range{depth(), depth(), random() % 2 ? 0.5f : 0, random() % 2 == 0};
    const Range sample = usableRange(depth(), depth());
    const RangeCut quick(range);
    const std::vector<Fragment> parts = cut(range, sample, 0.5);
    EXPECT_TRUE(!quick.leavesNothing(sample) || parts.empty());
    if (!quick.leavesWhole(sample)) continue;
    ASSERT_EQ(parts.size(), 1u);
    EXPECT_EQ(parts[0].range, sample);
    EXPECT_EQ(parts[0].alpha, 0.5);
    EXPECT_EQ(parts[0].weight, 1);
  }
}

TEST(DepthRange, PointsFadeInAStraightLine) {
  const DepthRange range{1, 5, 2};
  for (const auto& [z, fade] : {std::pair{1.5f, 0.25}, {2.0f, 0.5}, {3.0f, 1.0}, {4.5f, 0.25}}) {
    const std::vector<Fragment> parts = cut(range, {z, z}, 0.8);
    ASSERT_EQ(parts.size(), 1u) << z;
    EXPECT_NEAR(parts[0].alpha, 0.8 * fade, 1e-12) << z;
    EXPECT_NEAR(parts[0].weight, fade, 1e-12) << z;
  }
  EXPECT_TRUE(cut(range, {1, 1}, 0.8).empty());
  EXPECT_TRUE(cut(range, {5, 5}, 0.8).empty());
}

// Half of the range is the most that a soft end takes: the middle of a thin slab does not fade.
TEST(DepthRange, AThinSlabIsWholeInItsMiddle) {
  EXPECT_EQ(cut({1, 2, 100}, {1.5f, 1.5f}, 0.8)[0].alpha, 0.8);
}

TEST(DepthRange, AnOpaqueVolumeFadesByItsMean) {
  EXPECT_EQ(cut({1, kInfinity}, {0, 4}, 1)[0].alpha, 1);
  const std::vector<Fragment> parts = cut({1, kInfinity, 2}, {0, 5}, 1);  // 1/2 over a length of 2, 1 over another
  ASSERT_EQ(parts.size(), 1u);
  EXPECT_EQ(parts[0].alpha, 0.75);
  EXPECT_EQ(parts[0].weight, 0.75);
}

}  // namespace
}  // namespace fathom::deep
