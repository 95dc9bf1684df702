// At most so many samples in a pixel, and the same picture.
#include "deep/ops/limit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <set>

#include "base/error.h"
#include "deep/clip.h"
#include "deep/flatten.h"
#include "deep/ops/crop.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;
using reference::Sample;

void expectSamePicture(const flat::Image& a, const flat::Image& b, double bound, unsigned seed) {
  for (const char* name : {"R", "G", "B", "A"})
    for (size_t p = 0; p < a.get(name).values.size(); ++p)
      ASSERT_NEAR(a.get(name).values[p], b.get(name).values[p],
                  bound * std::max(1.0, std::abs(double(b.get(name).values[p]))))
          << name << ", pixel " << p << ", seed " << seed;
}

TEST(Limit, HoldsForEveryPixelAndThePictureStays) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const DeepImage image = randomSamples(
        {.seed = seed, .volumes = seed % 2 == 0, .most = 20, .odd = seed % 3 == 0, .sorted = seed % 4 != 0});
    const flat::Image before = flatten(image);
    for (const int most : {1, 2, 3, 7, 19, 100}) {
      const DeepImage result = limit(image.copy(), most);
      for (size_t p = 0; p < result.pixels(); ++p) ASSERT_LE(result.count(p), size_t(most)) << "seed " << seed;
      expectSamePicture(flatten(result), before, 2e-6, seed);
    }
  }
}

TEST(Limit, PixelsWithinItPassBitForBit) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true, .odd = true, .sorted = false});
    EXPECT_EQ(reference::difference(limit(image.copy(), 6), image), "") << "seed " << seed;
    const DeepImage three = limit(image.copy(), 3);
    for (size_t p = 0; p < image.pixels(); ++p) {
      if (image.count(p) > 3) continue;
      const int x = image.dataWindow.x0 + int(p % 9), y = image.dataWindow.y0 + int(p / 9);
      const Box pixel{x, y, x + 1, y + 1};
      ASSERT_EQ(reference::difference(toWindow(three, pixel), toWindow(image, pixel)), "") << "seed " << seed;
    }
  }
}

TEST(Limit, UnitesWhatIsClosestAndSeenLeast) {
  // Two pairs close together, and one faint sample near none.
  DeepImage image = randomSamples({.window = {0, 0, 1, 1}, .seed = 2, .most = 1});
  image.offsets[1] = 5;
  std::vector<std::string> names;
  for (const Channel& channel : image.channels) names.push_back(channel.name);
  for (const std::string& name : names) image.add(name, name == "id" ? PixelType::Uint : PixelType::Float);
  const float z[] = {1, 1.001f, 5, 5.5f, 9}, a[] = {0.2f, 0.2f, 0.5f, 1e-6f, 1};
  for (size_t i = 0; i < 5; ++i) {
    image.get("Z")[i] = z[i];
    for (const char* name : {"A", "R", "G", "B"}) image.get(name)[i] = a[i];
    image.find("id")->ids[i] = uint32_t(i);
  }
  const DeepImage four = limit(image.copy(), 4);
  ASSERT_EQ(four.samples(), 4u);
  EXPECT_EQ(four.find("id")->ids[2], 2u);
  EXPECT_NEAR(four.get("Z")[2], 5, 1e-4);
  EXPECT_EQ(four.get("Z")[0], 1.0f);
  const DeepImage three = limit(image.copy(), 3);
  ASSERT_EQ(three.samples(), 3u);
  EXPECT_EQ(three.find("id")->ids[0], 0u);
  EXPECT_NEAR(three.get("A")[0], 0.36f, 1e-6);
  EXPECT_NEAR(three.get("Z")[0], 1.0005f, 1e-3);
}

std::vector<Sample> limited(const std::vector<Sample>& pixel, int most) {
  return reference::samplesOf(limit(reference::makeDeep({pixel}, 1), most), 0);
}

// Two pairs equally far apart: it costs less to unite a little light with much than equal lights.
TEST(Limit, CountsTheLightThatMoves) {
  const auto three = limited({{.z = 1, .zBack = 1, .colour = 1},
                              {.z = 1.1f, .zBack = 1.1f, .colour = 1},
                              {.z = 10, .zBack = 10, .colour = 0.4f},
                              {.z = 11, .zBack = 11, .colour = 4}},
                             3);
  ASSERT_EQ(three.size(), 3u);
  EXPECT_EQ(three[0].z, 1);
  EXPECT_EQ(three[1].z, 1.1f);
}

TEST(Limit, UnitesToWhatIsSeenMost) {
  for (const float alpha : {0.9f, 0.1f}) {
    const auto one = limited({{.z = 1, .zBack = 1, .alpha = alpha}, {.z = 1, .zBack = 2, .alpha = 0.5f}}, 1);
    ASSERT_EQ(one.size(), 1u);
    EXPECT_EQ(one[0].z, 1);
    EXPECT_EQ(one[0].zBack, alpha > 0.5f ? 1 : 2) << "a point or a volume";
  }
  EXPECT_FLOAT_EQ(limited({{.z = 1, .zBack = 1, .alpha = 0.5f}, {.z = 3, .zBack = 3, .alpha = 1}}, 1)[0].z, 2);
}

TEST(Limit, WhatIsInfinitelyFarIsFarFromAll) {
  const float infinity = std::numeric_limits<float>::infinity();
  const auto behind = limited({{.z = 1, .zBack = 1, .alpha = 0.5f},
                               {.z = 2, .zBack = 2, .alpha = 0.5f},
                               {.z = infinity, .zBack = infinity, .alpha = 1}},
                              2);
  ASSERT_EQ(behind.size(), 2u);
  EXPECT_EQ(behind[1].z, infinity);
  const auto before = limited({{.z = -infinity, .zBack = -infinity, .alpha = 0.5f},
                               {.z = 1, .zBack = 1, .alpha = 0.5f},
                               {.z = 2, .zBack = 2, .alpha = 0.5f}},
                              2);
  ASSERT_EQ(before.size(), 2u);
  EXPECT_EQ(before[0].z, -infinity);
  const auto unseen = limited({{.z = 1, .zBack = 1, .alpha = 0.5f},
                               {.z = 10, .zBack = 10, .alpha = 0.5f},
                               {.z = 11, .zBack = 11, .alpha = 0.5f},
                               {.z = infinity, .zBack = infinity}},
                              2);
  ASSERT_EQ(unseen.size(), 2u);
  EXPECT_EQ(unseen[0].z, 1) << "what nothing is seen of moves nothing";
}

TEST(Limit, IdsAreThoseOfTheSource) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true, .most = 12, .odd = true, .sorted = false});
    const Buffer<uint32_t>& ids = image.find("id")->ids;
    const std::set<uint32_t> known(ids.begin(), ids.end());
    const DeepImage result = limit(image.copy(), 2);
    for (const uint32_t id : result.find("id")->ids) ASSERT_TRUE(known.contains(id)) << "seed " << seed;
  }
}

TEST(Limit, BandsGiveTheSameBitsAndChannels) {
  DeepImage image = randomSamples({.seed = 3, .volumes = true, .most = 12, .odd = true, .sorted = false});
  image.add("variance.R", PixelType::Float).values.fill(1);
  const DeepImage whole = limit(image.copy(), 4);
  EXPECT_FALSE(whole.find("variance.R"));
  for (int y = 2; y < 9; ++y)
    EXPECT_EQ(reference::difference(limit(rows(image, y, y + 1), 4), rows(whole, y, y + 1)), "");
  EXPECT_EQ(limit(rows(image, 4, 4), 4).channels.size(), whole.channels.size());
}

// n log n: a quadratic search would take minutes.
TEST(Limit, ManySamplesInOnePixel) {
  DeepImage image = randomSamples({.window = {0, 0, 1, 1}, .seed = 2, .most = 300000});
  for (size_t i = 0; i < image.samples(); ++i) image.get("A")[i] *= 1e-5f;
  ASSERT_GT(image.samples(), 100000u);
  const flat::Image before = flatten(image);
  const auto start = std::chrono::steady_clock::now();
  const DeepImage result = limit(std::move(image), 8);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
  EXPECT_EQ(result.samples(), 8u);
  expectSamePicture(flatten(result), before, 1e-5, 2);
}

TEST(Limit, RefusesNone) {
  EXPECT_THROW(limit(randomSamples({.seed = 1}), 0), Error);
}

}  // namespace
}  // namespace fathom::deep
