// A box in numbers against sums over lightOf and flatten.
#include "deep/box_statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/ops/crop.h"
#include "deep/ops/sample.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;

TEST(BoxStatistics, MeansAreThoseOfTheFlattened) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = seed % 2 == 0, .odd = seed % 3 == 0});
    const Box box{1, 3, 6, 20};
    const BoxStatistics found = boxStatistics(image, box);
    EXPECT_EQ(found.box, (Box{1, 3, 6, 9}));
    const flat::Image flat = flatten(crop(image, found.box));
    const auto mean = [&](const char* name) {
      const Buffer<float>& values = flat.get(name).values;
      return std::accumulate(values.begin(), values.end(), 0.0) / double(found.box.area());
    };
    EXPECT_NEAR(found.alpha, mean("A"), 1e-6);
    EXPECT_NEAR(found.colour[0], mean("R"), 1e-6);
    EXPECT_NEAR(found.colour[2], mean("B"), 1e-6);
    double energy = 0;
    for (const BinStatistics& bin : found.bins) energy += bin.energy;
    EXPECT_NEAR(energy, 0.2126 * mean("R") + 0.7152 * mean("G") + 0.0722 * mean("B"), 1e-6);
  }
}

TEST(BoxStatistics, BinsAreThoseOfEachPixel) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = seed % 2 == 0});
    const Box box{0, 2, 7, 8};
    const BoxStatistics found = boxStatistics(image, box);
    std::vector<BinStatistics> expected(found.bins.size());
    std::vector<double> weight(found.bins.size());
    const std::span<const float> zBack = image.tryGet("ZBack");
    uint64_t samples = 0, most = 0;
    for (int y = box.y0; y < box.y1; ++y)
      for (int x = box.x0; x < box.x1; ++x) {
        const std::vector<SampleLight> light = lightOf(image, x, y);
        const size_t first = image.offsets[image.dataWindow.index(x, y)];
        ASSERT_LE(light.size(), found.bins.size());
        samples += light.size();
        most = std::max<uint64_t>(most, light.size());
        for (size_t i = 0; i < light.size(); ++i) {
          const double z = image.get("Z")[first + i], end = zBack.empty() ? z : double(zBack[first + i]);
          ++expected[i].pixels;
          expected[i].alpha += light[i].seen / double(box.area());
          expected[i].depth += light[i].seen * (z + end) / 2;
          weight[i] += light[i].seen;
        }
      }
    EXPECT_EQ(found.counts.pixels, box.area());
    EXPECT_EQ(found.counts.samples, samples);
    EXPECT_EQ(found.counts.mostSamples, most);
    EXPECT_EQ(found.bins.size(), most);
    for (size_t i = 0; i < expected.size(); ++i) {
      EXPECT_EQ(found.bins[i].pixels, expected[i].pixels);
      EXPECT_NEAR(found.bins[i].alpha, expected[i].alpha, 1e-9);
      EXPECT_NEAR(found.bins[i].depth, expected[i].depth / weight[i], 1e-6);
    }
  }
}

TEST(BoxStatistics, WhatIsInfinitelyFarHasNoSayInTheDepth) {
  const float infinity = std::numeric_limits<float>::infinity();
  const DeepImage image = reference::makeDeep({{{.alpha = 0.5f}}, {{.z = infinity, .zBack = infinity, .alpha = 1}}}, 2);
  const BoxStatistics found = boxStatistics(image, image.dataWindow, {"R", "B", "B"});
  ASSERT_EQ(found.bins.size(), 1u);
  EXPECT_EQ(found.bins[0].depth, 1);
  EXPECT_EQ(found.bins[0].alpha, 0.75);
}

TEST(BoxStatistics, CountsAreThoseOfTheCroppedImage) {
  const DeepImage image = randomSamples({.seed = 3, .volumes = true, .odd = true});
  const Box box{1, 3, 6, 7};
  const Statistics found = boxStatistics(image, box).counts;
  Statistics expected;
  expected.add(crop(image, box));
  EXPECT_EQ(found.histogram, expected.histogram);
  EXPECT_EQ(found.nearest, expected.nearest);
  EXPECT_EQ(found.farthest, expected.farthest);
  EXPECT_EQ(found.volumes, expected.volumes);
  EXPECT_EQ(found.badDepths, expected.badDepths);
  EXPECT_EQ(found.mostX, expected.mostX);
  EXPECT_EQ(found.mostY, expected.mostY);
}

TEST(BoxStatistics, OutsideThereIsNothing) {
  const DeepImage image = randomSamples({});
  const BoxStatistics found = boxStatistics(image, {100, 100, 120, 120});
  EXPECT_EQ(found.counts.pixels, 0u);
  EXPECT_TRUE(found.bins.empty());
  EXPECT_THROW(boxStatistics(image, image.dataWindow, {"R", "G", "blue"}), Error);
}

}  // namespace
}  // namespace fathom::deep
