#include "deep/clip.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/tidy.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_deep.h"

namespace fathom::deep {
namespace {

using reference::makeDeep;
using reference::randomStack;
using reference::Sample;
using reference::samplesOf;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST(Clip, RangesAreHalfOpen) {
  const DeepImage image = makeDeep({{{1, 1, 0.5f, 0.1f, 7}, {2, 2, 0.5f, 0.2f, 8}, {3, 3, 0.5f, 0.3f, 9}}}, 1);
  const auto kept = samplesOf(clip(image, 1, 3), 0);
  ASSERT_EQ(kept.size(), 2u);
  EXPECT_EQ(kept[0].id, 7u);
  EXPECT_EQ(kept[1].id, 8u);
  EXPECT_EQ(clip(image, 3, 1).samples(), 0u);
  EXPECT_EQ(clip(image, 2, 2).samples(), 0u);
}

TEST(Clip, AVolumeIsCutIntoPartsThatMakeTheWhole) {
  const DeepImage image = makeDeep({{{2, 6, 0.75f, 0.3f, 5}}}, 1);
  const auto front = samplesOf(clip(image, 0, 4), 0), behind = samplesOf(clip(image, 4, 9), 0);
  ASSERT_EQ(front.size(), 1u);
  ASSERT_EQ(behind.size(), 1u);
  // Half the length lets the root of what the whole lets through pass: 0.5.
  for (const Sample& half : {front[0], behind[0]}) {
    EXPECT_FLOAT_EQ(half.alpha, 0.5f);
    EXPECT_FLOAT_EQ(half.colour, 0.2f);
    EXPECT_EQ(half.id, 5u);
  }
  EXPECT_EQ(front[0].z, 2);
  EXPECT_EQ(front[0].zBack, 4);
  EXPECT_EQ(behind[0].z, 4);
  EXPECT_EQ(behind[0].zBack, 6);
}

TEST(Clip, FrontOverBehindIsTheWhole) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const DeepImage image = randomStack(seed);
    const flat::Image whole = flatten(image);
    for (const float z : {0.0f, 0.7f, 1.3f, 2.0f, 3.1f, 50.0f}) {
      const flat::Image front = flatten(clip(image, -kInfinity, z)), behind = flatten(clip(image, z, kInfinity));
      for (const char* name : {"R", "B", "A"})
        for (size_t i = 0; i < image.pixels(); ++i) {
          const float passes = 1 - front.get("A").values[i];
          EXPECT_NEAR(front.get(name).values[i] + passes * behind.get(name).values[i], whole.get(name).values[i], 2e-6f)
              << name << " of pixel " << i << " at " << z << ", seed " << seed;
        }
    }
  }
}

TEST(Clip, WhatIsNotCutPassesBitForBit) {
  const DeepImage image = randomStack(3), all = clip(image, -kInfinity, kInfinity);
  ASSERT_EQ(all.samples(), image.samples());
  EXPECT_TRUE(std::ranges::equal(all.offsets, image.offsets));
  for (const Channel& channel : image.channels) {
    EXPECT_TRUE(std::ranges::equal(all.find(channel.name)->values, channel.values)) << channel.name;
    EXPECT_TRUE(std::ranges::equal(all.find(channel.name)->ids, channel.ids)) << channel.name;
  }
}

TEST(Clip, StatisticsOfCutSamplesAreVoid) {
  DeepImage image = makeDeep({{{2, 6, 0.75f, 0.3f, 5}}}, 1);
  for (const char* name : {"variance.R", "samples", "half0.R"}) image.add(name, PixelType::Float).values.fill(1);
  EXPECT_TRUE(clip(image, 0, 10).find("variance.R"));
  const DeepImage cut = clip(image, 0, 3);
  for (const char* name : {"variance.R", "samples", "half0.R"}) EXPECT_FALSE(cut.find(name)) << name;
  EXPECT_TRUE(cut.find("R"));
}

TEST(Clip, PlanesAtInfinityCutNothing) {
  const DeepImage image = makeDeep({{{1, 4, 0.5f, 0.1f, 7}, {kInfinity, kInfinity, 1, 0.2f, 8}}}, 1);
  EXPECT_EQ(clip(image, -kInfinity, kInfinity).samples(), 2u);
  EXPECT_EQ(clip(image, 1, kInfinity).samples(), 2u);
  EXPECT_EQ(clip(image, -kInfinity, 100).samples(), 1u);
  EXPECT_EQ(clip(image, kInfinity, kInfinity).samples(), 0u);
  EXPECT_FALSE(clipCuts(image, 1, kInfinity));
  EXPECT_FALSE(clipCuts(image, 0, 1));
  EXPECT_TRUE(clipCuts(image, 2, kInfinity));
}

TEST(Clip, IsTheSameForAnyBandOfRows) {
  const DeepImage image = randomStack(5), whole = clip(image, 1, 2);
  for (int y = image.dataWindow.y0; y < image.dataWindow.y1; ++y)
    EXPECT_EQ(reference::difference(clip(rows(image, y, y + 1), 1, 2), rows(whole, y, y + 1)), "");
}

flat::Image mapOf(const Box& window, float z) {
  flat::Image map{window, window, {}, {}};
  map.add("depth", z);
  return map;
}

TEST(ClipByMap, OfOneDepthIsClip) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomStack(seed);
    const flat::Image map = mapOf({0, -4, 20, 20}, 1.7f);
    EXPECT_EQ(reference::difference(clipByMap(image, map, "depth", Side::Front), clip(image, -kInfinity, 1.7f)), "");
    EXPECT_EQ(reference::difference(clipByMap(image, map, "depth", Side::Behind), clip(image, 1.7f, kInfinity)), "");
  }
}

TEST(ClipByMap, LeavesPixelsWithoutADepthAsTheyAre) {
  DeepImage image = randomStack(4);
  flat::Image map = mapOf({3, -2, 5, 0}, 0.0f);
  map.planes[0].values[0] = std::numeric_limits<float>::quiet_NaN();
  map.planes[0].values[1] = kInfinity;
  const DeepImage kept = clipByMap(image, map, "depth", Side::Front);
  for (int y = image.dataWindow.y0; y < image.dataWindow.y1; ++y)
    for (int x = image.dataWindow.x0; x < image.dataWindow.x1; ++x) {
      const size_t pixel = image.dataWindow.index(x, y);
      const bool cleared = map.dataWindow.contains(x, y) && y == -1;
      EXPECT_EQ(kept.count(pixel), cleared ? 0 : image.count(pixel)) << x << ", " << y;
    }
  EXPECT_THROW(clipByMap(image, map, "Z", Side::Front), Error);
  image.add("samples", PixelType::Float).values.fill(1);
  EXPECT_FALSE(clipByMap(image, map, "depth", Side::Front).find("samples"));
  image.erase("ZBack");
  EXPECT_TRUE(clipByMap(image, map, "depth", Side::Front).find("samples"));
}

TEST(Clip, WithoutZBackAllSamplesArePoints) {
  const DeepImage image = makeDeep({{{1, 9, 0.5f, 0.1f, 7}}, {{3, 9, 0.5f, 0.1f, 8}}}, 2, false);
  const DeepImage front = clip(image, 0, 2);
  EXPECT_EQ(front.count(0), 1u);
  EXPECT_EQ(front.count(1), 0u);
}

}  // namespace
}  // namespace fathom::deep
