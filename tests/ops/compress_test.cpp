// Compression: within the error at every depth, against the equation of transfer; exact as a whole; and few samples.
#include "deep/ops/compress.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/tidy.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/radiative.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;

// Depths on both sides of every border of samples, and between them.
std::vector<double> depthsOf(const std::vector<reference::Medium>& media) {
  std::vector<double> depths{0};
  for (const reference::Medium& medium : media)
    for (const double z : {medium.z, std::max(medium.z, medium.zBack)})
      for (const double offset : {-1e-9, 0.0, 1e-9, 0.11, 0.47}) depths.push_back(z * (1 + offset));
  return depths;
}

// How far two pixels are apart at any depth: in transmittance, and in colour relative to the brightest channel.
struct Distance {
  double transmittance = 0, colour = 0;
};

Distance distanceOf(const DeepImage& a, const DeepImage& b, size_t pixel) {
  Distance most;
  double brightest = 0;
  for (const char* name : {"R", "G", "B"}) {
    const auto one = reference::mediaOf(a, pixel, name), other = reference::mediaOf(b, pixel, name);
    brightest = std::max(brightest, reference::integrate(one).totalLight());
    for (const double z : depthsOf(reference::together(one, other))) {
      const auto seen = reference::integrate(one, 1, z), now = reference::integrate(other, 1, z);
      most.transmittance = std::max(most.transmittance, std::abs(seen.transmittance - now.transmittance));
      most.colour = std::max(most.colour, std::abs(seen.totalLight() - now.totalLight()));
    }
  }
  if (brightest > 0) most.colour /= brightest;
  return most;
}

TEST(Compress, IsWithinTheErrorAtEveryDepth) {
  size_t before = 0, after = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const double error = seed % 3 == 0 ? 0.1 : seed % 3 == 1 ? 0.02 : 0.001;
    DeepImage image = randomSamples(
        {.window = {0, 0, 3, 3}, .seed = seed, .volumes = seed % 4 != 0, .most = 25, .sorted = seed % 5 != 0});
    if (seed % 2)  // thin ones
      for (const char* name : {"R", "G", "B", "A"})
        for (float& value : image.get(name)) value *= 0.1f;
    const DeepImage small = compress(image.copy(), {.error = error});
    before += image.samples(), after += small.samples();
    EXPECT_TRUE(isTidy(small)) << "seed " << seed;
    for (size_t p = 0; p < image.pixels(); ++p) {
      const Distance distance = distanceOf(image, small, p);
      ASSERT_LE(distance.transmittance, error * 1.000001 + 1e-6) << "seed " << seed << ", pixel " << p;
      ASSERT_LE(distance.colour, error * 1.000001 + 1e-6) << "seed " << seed << ", pixel " << p;
    }
  }
  EXPECT_LT(after, before);
  RecordProperty("before", int(before));
  RecordProperty("after", int(after));
}

TEST(Compress, FlattensToTheSame) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const DeepImage image = randomSamples(
        {.seed = seed, .volumes = seed % 3 != 0, .most = 30, .odd = seed % 2 == 0, .sorted = seed % 5 != 0});
    const DeepImage compressed = compress(image.copy(), {.error = 0.05});
    EXPECT_TRUE(isTidy(compressed)) << "seed " << seed;
    const flat::Image whole = flatten(image), small = flatten(compressed);
    for (const char* name : {"R", "G", "B", "A"})
      for (size_t i = 0; i < whole.get(name).values.size(); ++i) {
        const float value = whole.get(name).values[i];
        ASSERT_NEAR(small.get(name).values[i], value, 2e-6 * std::max(1.0f, std::abs(value)))
            << name << ", seed " << seed;
      }
  }
}

// A volume cut into slices is one volume again.
TEST(Compress, PutsSlicesTogether) {
  reference::Pixels pixels(1);
  for (int i = 0; i < 1000; ++i)
    pixels[0].push_back(
        {.z = 1 + 0.01f * float(i), .zBack = 1 + 0.01f * float(i + 1), .alpha = 0.01f, .colour = 0.002f});
  const DeepImage small = compress(reference::makeDeep(pixels, 1), {});
  const std::vector<reference::Sample> samples = reference::samplesOf(small, 0);
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_EQ(samples[0].z, 1);
  EXPECT_EQ(samples[0].zBack, pixels[0].back().zBack);
  EXPECT_NEAR(samples[0].alpha, 1 - std::pow(0.99, 1000), 1e-6);
}

// How their curves would go on behind its end has no say.
TEST(Compress, LooksNoFurtherThanAVolume) {
  const DeepImage image =
      reference::makeDeep({{{.z = 1, .zBack = 1.5f, .alpha = 0.01f}, {.z = 1.5f, .zBack = 4, .alpha = 0.1f}}}, 1);
  EXPECT_EQ(compress(image.copy(), {.error = 0.01}).samples(), 1u);
}

// An opaque volume that hides more behind it begins where a point is: it must not become one.
TEST(Compress, PointsDoNotMeet) {
  const DeepImage image = reference::makeDeep({{{.z = 1, .zBack = 1, .alpha = 0.5f, .colour = 0.25f},
                                                {.z = 1, .zBack = 2, .alpha = 1, .colour = 1},
                                                {.z = 3, .zBack = 3, .alpha = 1, .colour = 1}}},
                                              1);
  const DeepImage small = compress(image.copy(), {});
  EXPECT_EQ(small.samples(), 2u);
  EXPECT_EQ(flatten(small).get("R").values[0], 0.75f);
}

TEST(Compress, LeavesWhatIsFarApart) {
  const DeepImage image = reference::makeDeep({{{.z = 1, .zBack = 1, .alpha = 0.5f, .colour = 0.25f, .id = 1},
                                                {.z = 2, .zBack = 4, .alpha = 0.9f, .colour = 0.1f, .id = 2},
                                                {.z = 5, .zBack = 5, .alpha = 1, .colour = 0.5f, .id = 3}}},
                                              1);
  EXPECT_EQ(reference::difference(compress(image.copy(), {}), image), "");
}

TEST(Compress, HardSurfacesStayWhereTheyAre) {
  reference::Pixels pixels(1);
  for (int i = 0; i < 9; ++i)
    pixels[0].push_back({.z = 1 + float(i), .zBack = 0, .alpha = 2e-5f, .colour = 1e-5f, .id = uint32_t(i)});
  pixels[0].push_back({.z = 12.5f, .zBack = 0, .alpha = 0.7f, .colour = 0.5f, .id = 77});
  for (int i = 0; i < 9; ++i)
    pixels[0].push_back({.z = 14 + float(i), .zBack = 0, .alpha = 2e-5f, .colour = 1e-5f, .id = uint32_t(i)});
  const std::vector<reference::Sample> samples = reference::samplesOf(compress(reference::makeDeep(pixels, 1), {}), 0);
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_EQ(samples[0].z, 12.5f);
  EXPECT_EQ(samples[0].zBack, 12.5f);
  EXPECT_EQ(samples[0].id, 77u);
}

// Of what is all within the error, the sample that changes most stays; where there are volumes, it is one.
TEST(Compress, StandsWhereMostIs) {
  const std::vector<reference::Sample> points =
      reference::samplesOf(compress(reference::makeDeep({{{.z = 1, .zBack = 1, .alpha = 0.002f},
                                                          {.z = 2, .zBack = 2, .alpha = 0.004f},
                                                          {.z = 3, .zBack = 3, .alpha = 0.002f}}},
                                                        1),
                                    {.error = 0.01}),
                           0);
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0].z, 2);
  EXPECT_EQ(points[0].zBack, 2);
  const std::vector<reference::Sample> volumes = reference::samplesOf(
      compress(reference::makeDeep({{{.z = 1, .zBack = 2, .alpha = 0.002f}, {.z = 2, .zBack = 3, .alpha = 0.003f}}}, 1),
               {.error = 0.01}),
      0);
  ASSERT_EQ(volumes.size(), 1u);
  EXPECT_EQ(volumes[0].z, 1);
  EXPECT_EQ(volumes[0].zBack, 3);
}

// Together they would be opaque as FLOAT, and hide all from their front on.
TEST(Compress, ThickVolumesStayApart) {
  const float alpha = float(-std::expm1(-9));
  DeepImage image =
      reference::makeDeep({{{.z = 1, .zBack = 2, .alpha = alpha}, {.z = 2, .zBack = 3, .alpha = alpha}}}, 1);
  image.add("G", PixelType::Float).values.fill(0);
  EXPECT_LE(distanceOf(image, compress(image.copy(), {.error = 1e-3}), 0).transmittance, 1.001e-3);
}

// Two volumes, each of 9 optical depths, whose alpha together is 1 as FLOAT.
TEST(Compress, BehindWhatIsOpaqueTogetherNothingIsLeft) {
  const float alpha = 1 - 0x1p-13f;
  const DeepImage image = reference::makeDeep({{{.z = 1, .zBack = 2, .alpha = alpha, .colour = 0.5f, .id = 1},
                                                {.z = 1, .zBack = 2, .alpha = alpha, .colour = 0.25f, .id = 2},
                                                {.z = 3, .zBack = 3, .alpha = 1, .colour = 9, .id = 3}}},
                                              1);
  const std::vector<reference::Sample> samples = reference::samplesOf(compress(image.copy(), {}), 0);
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_EQ(samples[0].z, 1);
  EXPECT_EQ(samples[0].zBack, 2);
  EXPECT_EQ(samples[0].alpha, 1);
  EXPECT_NEAR(samples[0].colour, (0.5 + 0.25) / 2 / double(alpha), 1e-6);
}

TEST(Compress, OfEmissionPlainChannelsAreMeans) {
  DeepImage image = reference::makeDeep(
      {{{.z = 1, .zBack = 1, .colour = 0.5f, .id = 5}, {.z = 2, .zBack = 2, .colour = 1e-5f, .id = 6}}}, 1);
  Buffer<float>& coc = image.add("coc", PixelType::Float).values;
  coc[0] = 1;
  coc[1] = 4;
  const DeepImage small = compress(std::move(image), {});
  ASSERT_EQ(small.samples(), 1u);
  EXPECT_FLOAT_EQ(small.get("coc")[0], 2.5f);
}

TEST(Compress, WhatIsHiddenGoesAndEmissionStays) {
  const DeepImage image = reference::makeDeep(
      {{{.z = 1, .zBack = 1, .alpha = 1, .colour = 0.5f, .id = 5}, {.z = 2, .zBack = 2, .alpha = 0.5f, .colour = 9}},
       {{.z = 1, .zBack = 1, .colour = 0.5f, .id = 5}, {.z = 2, .zBack = 2, .colour = 0.25f, .id = 6}}},
      2);
  const DeepImage small = compress(image.copy(), {});
  ASSERT_EQ(small.samples(), 3u);
  EXPECT_EQ(small.get("R")[0], 0.5f);
  EXPECT_EQ(small.get("A")[0], 1);
  EXPECT_EQ(small.find("id")->ids[0], 5u);
  EXPECT_EQ(small.get("R")[2], 0.25f);
}

TEST(Compress, CameraSamplesAtOneDepthStayApartInTheFlattened) {
  DeepImage image =
      reference::makeDeep({{{.z = 1, .alpha = 0.5f, .colour = 0.5f}, {.z = 1, .alpha = 1, .colour = 0.1f}}}, 1, false);
  image.attributes.set("fathom:spp", 2);
  const DeepImage small = compress(image.copy(), {.error = 1e-6});
  EXPECT_EQ(small.samples(), 1u);
  EXPECT_NEAR(small.get("R")[0], 0.55f, 1e-6);
  // Of what is seen of them, the first is most.
  image = reference::makeDeep({{{.z = 1, .alpha = 0.6f, .id = 1}, {.z = 1, .alpha = 1, .id = 2}}}, 1, false);
  image.attributes.set("fathom:spp", 2);
  EXPECT_EQ(compress(std::move(image), {.error = 1e-6}).find("id")->ids[0], 1u);
}

TEST(Compress, ThousandsOfSamplesInOnePixel) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(0, 1);
  reference::Pixels pixels(1);
  for (int i = 0; i < 200000; ++i) {
    const float alpha = 4e-5f * unit(random);
    pixels[0].push_back({.z = 1 + unit(random), .zBack = 0, .alpha = alpha, .colour = alpha * unit(random)});
  }
  const auto start = std::chrono::steady_clock::now();
  const DeepImage small = compress(reference::makeDeep(pixels, 1), {});
  EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(), 5) << "it is not n log n";
  EXPECT_LT(small.samples(), 50u);
  RecordProperty("samples", int(small.samples()));
}

TEST(Compress, TakesEmptyImagesAndRefusesWhatItCannot) {
  DeepImage image = randomSamples({.seed = 1});
  EXPECT_EQ(compress(rows(image, 4, 4), {}).samples(), 0u);
  EXPECT_THROW(compress(image.copy(), {.error = 0}), Error);
  EXPECT_THROW(compress(image.copy(), {.error = std::numeric_limits<double>::quiet_NaN()}), Error);
  image.erase("G");
  EXPECT_NO_THROW(compress(image.copy(), {}));
  image.add("variance.R", PixelType::Float).values.fill(1);
  EXPECT_FALSE(compress(image.copy(), {}).find("variance.R"));
  image.erase("A");
  EXPECT_THROW(compress(image.copy(), {}), Error);
}

}  // namespace
}  // namespace fathom::deep
