// The depths of a flattened pixel, and that pixels in order are composited as those are that must be sorted first. See
// tests/deep/tidy_test.cpp for colours and alpha.
#include "deep/flatten.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/error.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"
#include "tests/reference/transmittance.h"

namespace fathom::deep {
namespace {

using reference::makeDeep;
using reference::PixelSamples;
using reference::randomSamples;
using enum FlatDepth;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
const FlattenParams kAllDepths = {.depths = {Mean, Front, Back, Transmittance}};

PixelSamples samplesAt(const DeepImage& image, size_t pixel) {
  const size_t first = image.offsets[pixel], count = image.count(pixel);
  const auto zBack = image.tryGet("ZBack");
  return {image.get("A").subspan(first, count), image.get("Z").subspan(first, count),
          zBack.empty() ? zBack : zBack.subspan(first, count)};
}

std::vector<float> depthsOf(const std::vector<reference::Sample>& samples, double transmittance = 0.5) {
  FlattenParams params = kAllDepths;
  params.transmittance = transmittance;
  const flat::Image flat = flatten(makeDeep({samples}, 1), params);
  return {flat.get("Z.front").values[0], flat.get("Z.transmittance").values[0], flat.get("Z.back").values[0]};
}

DeepImage reversed(const DeepImage& image) {
  DeepImage result = image.copy();
  for (size_t p = 0; p < image.pixels(); ++p)
    for (Channel& channel : result.channels) {
      if (channel.type == PixelType::Uint) continue;
      std::reverse(channel.values.begin() + image.offsets[p], channel.values.begin() + image.offsets[p + 1]);
    }
  return result;
}

TEST(FlattenDepths, AgreeWithTheTransmittanceOfAllSamples) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = seed % 2 == 0, .most = 9, .sorted = seed % 3 != 0});
    for (const double passes : {0.0, 1e-9, 0.1, 0.5, 0.9, 0.9999}) {
      FlattenParams params = kAllDepths;
      params.transmittance = passes;
      const flat::Image flat = flatten(image, params);
      for (size_t p = 0; p < image.pixels(); ++p) {
        const PixelSamples pixel = samplesAt(image, p);
        if (pixel.z.empty()) continue;
        const float front = flat.get("Z.front").values[p], back = flat.get("Z.back").values[p];
        const float depth = flat.get("Z.transmittance").values[p];
        ASSERT_EQ(front, reference::firstSeen(pixel)) << "seed " << seed << " pixel " << p;
        ASSERT_EQ(back, reference::lastSeen(pixel)) << "seed " << seed << " pixel " << p;
        const double before = double(reference::transmittance(pixel, std::nextafter(depth, 0.0f), false));
        const double behind = double(reference::transmittance(pixel, std::nextafter(depth, kInfinity), true));
        ASSERT_GE(before, passes - 1e-6) << "seed " << seed << " pixel " << p;
        ASSERT_TRUE(depth == back || behind <= passes + 1e-6) << "seed " << seed << " pixel " << p;
      }
    }
  }
}

TEST(FlattenDepths, InsideOfAVolumeAreExact) {
  // Half of the light of a volume of alpha 0.75 is gone in the middle.
  EXPECT_EQ(depthsOf({{2, 6, 0.75f, 1}}), (std::vector<float>{2, 4, 6}));
  // The same with a point in front that leaves 0.8 of it: log(0.5 / 0.8) / log(0.25) of the length.
  EXPECT_FLOAT_EQ(depthsOf({{1, 1, 0.2f, 1}, {2, 6, 0.75f, 1}})[1], float(2 + 4 * std::log(0.625) / std::log(0.25)));
}

TEST(FlattenDepths, EndAtWhatIsOpaque) {
  EXPECT_EQ(depthsOf({{1, 1, 0.25f, 1}, {3, 5, 1, 1}, {6, 6, 0.5f, 1}}), (std::vector<float>{1, 3, 3}));
  EXPECT_EQ(depthsOf({{1, 1, 0.25f, 1}, {3, 5, 0.25f, 1}}), (std::vector<float>{1, 5, 5}));  // 0.5 is never reached
}

TEST(FlattenDepths, OfLightWithoutAlphaAreTheNearest) {
  EXPECT_EQ(depthsOf({{4, 4, 0, 1}, {2, 3, 0, 1}}), (std::vector<float>{2, 2, 2}));
  EXPECT_EQ(depthsOf({{4, 4, 0, 1}, {5, 6, 0.5f, 1}, {7, 7, 0, 1}}, 0.9)[0], 5);
  EXPECT_EQ(depthsOf({}), (std::vector<float>{0, 0, 0}));
}

TEST(FlattenDepths, AtInfinityHaveNoSayWhereOthersAreSeen) {
  EXPECT_EQ(depthsOf({{-kInfinity, 0, 0.5f, 1}, {3, 3, 0.5f, 1}, {kInfinity, 0, 1, 1}}), (std::vector<float>{3, 3, 3}));
  EXPECT_EQ(depthsOf({{kInfinity, 0, 1, 1}})[1], kInfinity);
}

TEST(FlattenDepths, AreInOrderForOddInput) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const flat::Image flat =
        flatten(randomSamples({.seed = seed, .volumes = true, .odd = true, .sorted = seed % 2 == 0}), kAllDepths);
    const auto at = [&](const char* name, size_t p) { return flat.get(name).values[p]; };
    for (size_t p = 0; p < flat.dataWindow.area(); ++p) {
      ASSERT_LE(at("Z.front", p), at("Z.transmittance", p)) << "seed " << seed << " pixel " << p;
      ASSERT_LE(at("Z.transmittance", p), at("Z.back", p)) << "seed " << seed << " pixel " << p;
      ASSERT_LE(at("Z.front", p), at("Z.mean", p)) << "seed " << seed << " pixel " << p;
    }
  }
}

TEST(FlattenDepths, ZIsTheOneThatWasAskedFor) {
  const DeepImage image = randomSamples({.seed = 3, .volumes = true});
  const flat::Image all = flatten(image, kAllDepths);
  for (const auto& [depth, name] :
       {std::pair{Mean, "Z.mean"}, {Front, "Z.front"}, {Back, "Z.back"}, {Transmittance, "Z.transmittance"}}) {
    const flat::Image one = flatten(image, {.z = depth});
    EXPECT_EQ(std::memcmp(one.get("Z").values.data(), all.get(name).values.data(), 4 * image.pixels()), 0) << name;
    EXPECT_FALSE(one.find("Z.front"));
  }
}

TEST(FlattenDepths, TakeTheNameOfAChannel) {
  DeepImage image = makeDeep({{{2, 2, 1, 1, 1}}}, 1);
  image.add("Z.front", PixelType::Float).values.fill(9);
  EXPECT_EQ(flatten(image, {.depths = {Front, Front}}).get("Z.front").values[0], 2);
  EXPECT_EQ(flatten(image).get("Z.front").values[0], 9);
}

TEST(FlattenDepths, RefuseATransmittanceThatIsNone) {
  for (const double passes : {-0.1, 1.0, std::nan("")})
    EXPECT_THROW(flatten(makeDeep({{}}, 1), {.transmittance = passes}), Error);
}

TEST(Flatten, OfSamplesInAnyOrderIsTheSame) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = seed % 2 == 0, .most = 9});
    const flat::Image sorted = flatten(image, kAllDepths), other = flatten(reversed(image), kAllDepths);
    for (const flat::Plane& plane : sorted.planes) {
      const bool colour = plane.name.size() == 1 && plane.name != "A" && plane.name != "Z";  // sums in another order
      for (size_t p = 0; p < image.pixels(); ++p)
        ASSERT_NEAR(plane.values[p], other.get(plane.name).values[p], colour ? 1e-6 : 0)
            << plane.name << " seed " << seed << " pixel " << p;
    }
  }
}

TEST(Flatten, OfNoRowsHasTheChannels) {
  DeepImage image = randomSamples({.seed = 1});
  const flat::Image flat = flatten(rows(image, image.dataWindow.y0, image.dataWindow.y0), kAllDepths);
  EXPECT_EQ(flat.planes.size(), 9u);
  image.erase("A");
  EXPECT_THROW(flatten(rows(image, image.dataWindow.y0, image.dataWindow.y0)), Error);
}

}  // namespace
}  // namespace fathom::deep
