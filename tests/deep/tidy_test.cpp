// Tidying and flattening: laws, sweeps against the twins of tests/reference, and input that no program should write.
#include "deep/tidy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cstring>
#include <limits>
#include <random>

#include "base/error.h"
#include "deep/flatten.h"
#include "tests/reference/tidy.h"

namespace fathom::deep {
namespace {

using reference::makeDeep;
using reference::Pixels;
using reference::Sample;
using reference::samplesOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Depths on a coarse grid, so that points and volumes meet, touch, contain and equal each other often; alphas of 0 and
// 1 included.
Pixels randomPixels(unsigned seed, size_t count, size_t most) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> depth(1, 12), kind(0, 9);
  std::uniform_real_distribution<float> uniform(0.01f, 0.99f);
  Pixels pixels(count);
  for (size_t p = 0; p < count; ++p)
    for (size_t i = 0; i < p % (most + 1); ++i) {
      const float z = float(depth(random)), zBack = kind(random) < 6 ? float(depth(random)) : z;
      const int k = kind(random);
      const float alpha = k == 0 ? 0 : k == 1 ? 1 : uniform(random);
      pixels[p].push_back({std::min(z, zBack), std::max(z, zBack), alpha, uniform(random) * 3, uint32_t(100 * p + i)});
    }
  return pixels;
}

template <class Values>
auto listOf(const Values& values) {
  return std::vector(values.begin(), values.end());
}

bool sameBits(const DeepImage& a, const DeepImage& b) {
  if (a.channels.size() != b.channels.size() || a.samples() != b.samples()) return false;
  for (size_t i = 0; i <= a.pixels(); ++i)
    if (a.offsets[i] != b.offsets[i]) return false;
  for (const Channel& channel : a.channels) {
    const Channel* other = b.find(channel.name);
    if (!other || other->type != channel.type) return false;
    const void* there = channel.type == PixelType::Uint ? (const void*)channel.ids.data() : channel.values.data();
    const void* here = channel.type == PixelType::Uint ? (const void*)other->ids.data() : other->values.data();
    if (std::memcmp(there, here, 4 * a.samples()) != 0) return false;
  }
  return true;
}

bool sameBits(const flat::Image& a, const flat::Image& b) {
  for (size_t c = 0; c < a.planes.size(); ++c)
    if (std::memcmp(a.planes[c].values.data(), b.planes[c].values.data(), 4 * a.dataWindow.area()) != 0) return false;
  return a.planes.size() == b.planes.size();
}

TEST(Tidy, AgreesWithTheTwin) {
  for (const size_t most : {1, 2, 3, 5, 9, 20}) {
    const Pixels pixels = randomPixels(unsigned(most), 400, most);
    const DeepImage image = tidy(makeDeep(pixels, 20)).image;
    for (size_t p = 0; p < pixels.size(); ++p) {
      const std::vector<reference::Piece> expected = reference::tidy(pixels[p]);
      const std::vector<Sample> found = samplesOf(image, p);
      ASSERT_EQ(found.size(), expected.size()) << "pixel " << p << ", up to " << most << " samples";
      for (size_t i = 0; i < found.size(); ++i) {
        EXPECT_EQ(found[i].z, float(expected[i].z));
        EXPECT_EQ(found[i].zBack, float(expected[i].zBack));
        EXPECT_NEAR(found[i].alpha, double(expected[i].alpha), 2e-7) << "pixel " << p << " piece " << i;
        EXPECT_NEAR(found[i].colour, double(expected[i].colour), 1e-6 * (1 + double(expected[i].colour)))
            << "pixel " << p << " piece " << i;
      }
    }
  }
}

TEST(Tidy, TwiceIsOnceBitForBit) {
  for (unsigned seed = 1; seed < 6; ++seed) {
    const DeepImage once = tidy(makeDeep(randomPixels(seed, 300, 12), 20)).image;
    EXPECT_TRUE(isTidy(once));
    EXPECT_TRUE(sameBits(tidy(once.copy()).image, once));
  }
}

TEST(Tidy, LeavesTidyImagesAlone) {
  const DeepImage image = makeDeep({{{1, 3, 0.5f, kNan, 4}, {3, 3, 2, 0.1f, 5}, {3, 4, -1, 1, 6}}, {}}, 2);
  EXPECT_TRUE(isTidy(image));
  const TidyResult result = tidy(image.copy());
  EXPECT_TRUE(sameBits(result.image, image));
}

TEST(Tidy, PassesUntouchedSamplesBitForBit) {
  DeepImage image = tidy(makeDeep({{{5, 5, 1.5f, kNan, 4}, {1, 2, -0.5f, 3, 5}}}, 1)).image;
  const std::vector<Sample> samples = samplesOf(image, 0);
  EXPECT_EQ(samples[0].alpha, -0.5f);
  EXPECT_EQ(samples[1].alpha, 1.5f);
  EXPECT_TRUE(std::isnan(samples[1].colour));
  EXPECT_EQ(samples[1].id, 4u);
}

TEST(Tidy, SplitsAVolumeAroundAPoint) {
  const std::vector<Sample> samples =
      samplesOf(tidy(makeDeep({{{1, 5, 0.75f, 0.75f, 1}, {3, 3, 0.5f, 0.25f, 2}}}, 1)).image, 0);
  ASSERT_EQ(samples.size(), 3u);
  EXPECT_FLOAT_EQ(samples[0].alpha, 0.5f);
  EXPECT_FLOAT_EQ(samples[0].colour, 0.5f);
  EXPECT_EQ(samples[0].zBack, 3);
  EXPECT_EQ(samples[1].id, 2u);
  EXPECT_EQ(samples[1].colour, 0.25f);
  EXPECT_FLOAT_EQ(samples[2].alpha, 0.5f);
  EXPECT_EQ(samples[2].z, 3);
  EXPECT_EQ(samples[2].zBack, 5);
}

TEST(Tidy, TheLargerShareKeepsItsId) {
  const DeepImage image = tidy(makeDeep({{{1, 3, 0.3f, 1, 1}, {1, 2, 0.6f, 1, 2}, {2, 3, 0.01f, 1, 3}}}, 1)).image;
  EXPECT_THAT(listOf(image.find("id")->ids), ElementsAre(2u, 1u));
}

TEST(Tidy, OpaquePointsAverageWhateverTheirOrder) {
  std::vector<Sample> samples = {{2, 2, 1, 0.1f, 1}, {2, 2, 1, 0.7f, 2}, {2, 2, 0.5f, 9, 3}, {2, 2, 1, 0.4f, 4}};
  std::sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) { return a.id < b.id; });
  do {
    const std::vector<Sample> merged = samplesOf(tidy(makeDeep({samples}, 1)).image, 0);
    ASSERT_EQ(merged.size(), 1u);
    EXPECT_FLOAT_EQ(merged[0].colour, 0.4f);
    EXPECT_EQ(merged[0].alpha, 1);
  } while (std::next_permutation(samples.begin(), samples.end(),
                                 [](const Sample& a, const Sample& b) { return a.id < b.id; }));
}

TEST(Tidy, KeepsEmission) {
  const std::vector<Sample> samples = samplesOf(tidy(makeDeep({{{1, 3, 0, 4, 1}, {2, 4, 0, 6, 2}}}, 1)).image, 0);
  ASSERT_EQ(samples.size(), 3u);
  EXPECT_FLOAT_EQ(samples[0].colour, 2);
  EXPECT_FLOAT_EQ(samples[1].colour, 5);
  EXPECT_FLOAT_EQ(samples[2].colour, 3);
}

TEST(Tidy, DropsStatisticsOnlyWhereItSplits) {
  const auto withStatistics = [](const Pixels& pixels) {
    DeepImage image = makeDeep(pixels, 1);
    for (const char* name : {"samples", "variance.R", "half0.R", "half0.samples"})
      image.add(name, PixelType::Float).values.fill(1);
    return image;
  };
  const TidyResult sorted = tidy(withStatistics({{{3, 3, 1, 1, 1}, {2, 2, 0.5f, 1, 2}}}));
  EXPECT_THAT(sorted.dropped, ElementsAre());
  EXPECT_TRUE(sorted.image.find("half0.R"));
  const TidyResult split = tidy(withStatistics({{{2, 4, 0.5f, 1, 1}, {3, 3, 0.5f, 1, 2}, {3, 3, 1, 1, 3}}}));
  EXPECT_THAT(split.dropped, ElementsAre("samples", "variance.R", "half0.R", "half0.samples"));
  EXPECT_FALSE(split.image.find("samples"));
  EXPECT_EQ(split.image.samples(), 3u);  // nothing is left that the two points' own statistics would describe
}

TEST(Tidy, WhatStaysAsItIsKeepsItsState) {
  DeepImage image = makeDeep({{{4, 4, 0.5f, 1, 4}, {4, 4, 1, 2, 5}}}, 1);
  image.attributes.set("fathom:spp", 2);
  image.attributes.set("deepImageState", 2);
  EXPECT_TRUE(tidy(std::move(image)).image.attributes.getInt("deepImageState"));
}

TEST(Tidy, CameraSamplesAtTheSameDepthStayApart) {
  const Pixels pixels = {{{1, 3, 0.5f, 1, 1}, {2, 2, 0.5f, 1, 2}, {2, 2, 0.25f, 1, 3}},
                         {{4, 4, 1, 1, 4}, {4, 4, 1, 2, 5}}};
  DeepImage image = makeDeep(pixels, 2);
  image.attributes.set("fathom:spp", 4);
  const DeepImage apart = tidy(image.copy()).image;
  EXPECT_THAT(listOf(apart.find("id")->ids), ElementsAre(1, 2, 3, 1, 4, 5));
  const flat::Image before = flatten(image), after = flatten(apart);
  for (const char* name : {"A", "R"})
    for (size_t i = 0; i < 2; ++i) EXPECT_NEAR(before.get(name).values[i], after.get(name).values[i], 1e-6) << name;
}

TEST(Tidy, AveragesWhatIsNotPremultiplied) {
  DeepImage image = makeDeep({{{1, 2, 0.5f, 1, 1}, {1, 2, 0.75f, 1, 2}}}, 1);
  Buffer<float>& coc = image.add("coc", PixelType::Float).values;
  coc[0] = 3;
  coc[1] = 6;
  EXPECT_FLOAT_EQ(tidy(std::move(image)).image.get("coc")[0], 5);  // optical depths 1 : 2
}

TEST(Tidy, NonFiniteColoursDoNotSpread) {
  const std::vector<Sample> samples =
      samplesOf(tidy(makeDeep({{{1, 3, 0.5f, kNan, 1}, {1, 3, 0.5f, 1, 2}}}, 1)).image, 0);
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_TRUE(std::isfinite(samples[0].colour));
  EXPECT_GT(samples[0].colour, 0);
}

TEST(Tidy, EndsForEveryDepth) {
  const std::vector<float> odd = {-kInfinity, -1, -0.0f, 0, 1e-45f, 1.5f, 3e38f, kInfinity, kNan};
  Pixels pixels;
  for (const float z : odd)
    for (const float zBack : odd) {
      pixels.push_back({});
      for (const float other : odd) {
        pixels.back().push_back({z, zBack, 0.25f, 1, 1});
        pixels.back().push_back({other, zBack, 0.5f, 1, 2});
        pixels.back().push_back({z, other, kNan, 1, 3});
      }
    }
  const DeepImage once = tidy(makeDeep(pixels, 9)).image;
  EXPECT_TRUE(isTidy(once));
  EXPECT_TRUE(sameBits(tidy(once.copy()).image, once));
  for (const float z : once.get("Z")) EXPECT_FALSE(std::isnan(z));
}

TEST(Tidy, VolumesAtTheSmallestDepths) {
  const float tiny = std::numeric_limits<float>::denorm_min();
  const DeepImage image = tidy(makeDeep({{{0, 3 * tiny, 0.5f, 1, 1}, {tiny, 2 * tiny, 0.5f, 1, 2}}}, 1)).image;
  EXPECT_TRUE(isTidy(image));
  EXPECT_EQ(image.samples(), 3u);
}

TEST(Tidy, RefusesMoreOverlapThanIsWorthIt) {
  Pixels pixels(1);
  for (int i = 0; i < 20000; ++i) pixels[0].push_back({1 + float(i) / 32, 2000 + float(i) / 32, 0.5f, 1, 1});
  try {
    tidy(makeDeep(pixels, 1));
    FAIL() << "expected an error";
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("pixel (3, -2)"));
    EXPECT_THAT(e.what(), HasSubstr("found 400"));
  }
}

TEST(Tidy, ManyOverlapsArePossible) {
  Pixels pixels(1);
  for (int i = 0; i < 1000; ++i) pixels[0].push_back({1 + float(i) / 32, 100 + float(i) / 32, 0.001f, 1, 1});
  const DeepImage image = tidy(makeDeep(pixels, 1)).image;
  EXPECT_EQ(image.samples(), 1999u);
  const flat::Image flat = flatten(image);
  EXPECT_NEAR(flat.get("A").values[0], 1 - std::pow(0.999, 1000), 1e-5);
}

TEST(Tidy, UntidinessIsNamed) {
  const auto of = [](const std::vector<Sample>& samples) { return findUntidiness(makeDeep({samples}, 1)); };
  EXPECT_TRUE(of({{2, 2}, {1, 1}}).unsorted);
  EXPECT_TRUE(of({{2, 1}}).unsorted);
  EXPECT_TRUE(of({{kNan, 1}}).unsorted);
  EXPECT_FALSE(of({{2, 2}, {1, 1}}).volumesOverlap);
  EXPECT_TRUE(of({{1, 1}, {1, 1}}).pointsCoincide);
  EXPECT_FALSE(of({{1, 1}, {1, 1}}).unsorted);
  EXPECT_TRUE(of({{1, 3}, {1, 3}}).volumesOverlap);
  EXPECT_FALSE(of({{1, 3}, {1, 3}}).pointsCoincide);
  EXPECT_TRUE(of({{1, 3}, {2, 2}}).volumesOverlap);
  EXPECT_FALSE(of({{1, 1}, {1, 3}, {3, 3}, {3, 4}}).any());
}

TEST(Tidy, SortingPermutesEveryChannel) {
  const DeepImage image = sortSamples(
      makeDeep({{{3, 4, 0.3f, 3, 30}, {kNan, 1, 0.9f, 9, 90}, {1, 1, 0.1f, 1, 10}, {3, 3, 0.2f, 2, 20}}}, 1));
  EXPECT_THAT(listOf(image.find("id")->ids), ElementsAre(10u, 20u, 30u, 90u));
  EXPECT_THAT(listOf(image.get("A")), ElementsAre(0.1f, 0.2f, 0.3f, 0.9f));
  EXPECT_TRUE(std::isnan(image.get("Z")[3]));
}

TEST(Flatten, AgreesWithTheTwin) {
  const Pixels pixels = randomPixels(7, 1000, 20);
  const flat::Image image = flatten(makeDeep(pixels, 20));
  for (size_t p = 0; p < pixels.size(); ++p) {
    const reference::Piece expected = reference::flatten(reference::tidy(pixels[p]));
    EXPECT_NEAR(image.get("A").values[p], double(expected.alpha), 1.3e-7) << p;
    EXPECT_NEAR(image.get("R").values[p], double(expected.colour), 2e-7 * (1 + double(expected.colour))) << p;
    EXPECT_FLOAT_EQ(image.get("B").values[p], 2 * image.get("R").values[p]);
  }
}

TEST(Flatten, OfTheTidyImageIsTheSame) {
  const DeepImage image = makeDeep(randomPixels(8, 1000, 12), 20);
  const flat::Image before = flatten(image), after = flatten(tidy(image.copy()).image);
  for (const char* name : {"R", "A", "Z"})
    for (size_t p = 0; p < image.pixels(); ++p)
      EXPECT_NEAR(after.get(name).values[p], before.get(name).values[p],
                  2e-6 * (1 + std::abs(before.get(name).values[p])))
          << name;
}

TEST(Flatten, IsExactForThinAndForNearlyOpaqueSamples) {
  const flat::Image image = flatten(makeDeep({{{1, 1, 1e-8f, 1, 1}, {2, 2, 1e-8f, 1, 2}}, {{1, 1, 1e-38f, 1, 1}}}, 2));
  EXPECT_FLOAT_EQ(image.get("A").values[0], 2e-8f);
  EXPECT_FLOAT_EQ(image.get("A").values[1], 1e-38f);
}

TEST(Flatten, DepthIsTheMeanOfWhatIsSeen) {
  const flat::Image image = flatten(makeDeep({{{1, 3, 0.5f, 1, 1}, {6, 6, 1, 1, 2}, {9, 9, 1, 1, 3}},
                                              {{7, 7, 0, 1, 1}, {5, 5, 0, 1, 2}},
                                              {},
                                              {{2, 2, 0.5f, 1, 1}, {kInfinity, 1, 1, 1, 2}}},
                                             4));
  EXPECT_THAT(listOf(image.get("Z").values), ElementsAre(4, 5, 0, 2));
  EXPECT_THAT(listOf(image.get("A").values), ElementsAre(1, 0, 0, 1));
  EXPECT_THAT(listOf(image.get("R").values), ElementsAre(1.5f, 2, 0, 1.5f));
}

TEST(Flatten, LeavesOutWhatCannotBeComposited) {
  DeepImage image = makeDeep({{{1, 1, 1, 1, 1}}}, 1);
  for (const char* name : {"variance.R", "samples", "half0.samples", "half0.R"})
    image.add(name, PixelType::Float).values.fill(1);
  const flat::Image flat = flatten(image);
  std::vector<std::string> names;
  for (const flat::Plane& plane : flat.planes) names.push_back(plane.name);
  EXPECT_THAT(names, ElementsAre("R", "B", "A", "Z", "half0.R"));
}

TEST(Flatten, CompositesCameraSamplesAtTheSameDepthOneByOne) {
  // Four camera samples of a quarter each, the last two at one depth: merged, the last would hide the one before.
  const Pixels pixels = {
      {{1, 1, 0.25f, 0.25f, 1}, {2, 2, 1 / 3.0f, 2 / 3.0f, 2}, {4, 4, 0.5f, 1.5f, 3}, {4, 4, 1, 4, 4}}};
  DeepImage image = makeDeep(pixels, 1);
  image.attributes.set("fathom:spp", 4);
  EXPECT_FLOAT_EQ(flatten(image).get("R").values[0], 2.5f);
}

TEST(Flatten, CarriesAttributesWithTheirTypes) {
  DeepImage image = makeDeep({{{1, 1, 1, 1, 1}}}, 1);
  image.attributes.set("fathom:spp", 4);
  image.attributes.set("fathom:ppuScale", 700.0f);
  image.attributes.set("artist", std::string("A. Nonymous"));
  image.attributes.set("worldToCamera", std::array<float, 16>{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.5f, 0, 0, 1});
  const auto attributes = flatten(image).attributes;
  EXPECT_EQ(attributes.at("fathom:spp"), "4");
  EXPECT_EQ(attributes.at("fathom:ppuScale"), "700.0");
  EXPECT_EQ(attributes.at("artist"), "A. Nonymous");
  EXPECT_THAT(attributes.at("worldToCamera"), HasSubstr("0.5, 0.0, 0.0, 1.0"));
}

TEST(Flatten, NonFiniteValuesCountAsNothing) {
  const flat::Image image = flatten(makeDeep({{{1, 1, 0.5f, kNan, 1}, {2, 2, 0.5f, 2, 2}, {3, 3, kNan, 1, 3}}}, 1));
  EXPECT_FLOAT_EQ(image.get("R").values[0], 1.25f);
  EXPECT_FLOAT_EQ(image.get("A").values[0], 0.75f);
}

TEST(Flatten, NeedsAlphaAndDepth) {
  for (const char* name : {"A", "Z"}) {
    DeepImage image = makeDeep({{{2, 2, 1, 1, 1}, {1, 1, 1, 1, 1}}}, 1);
    image.erase(name);
    EXPECT_THROW(flatten(image), Error);
    EXPECT_THROW(tidy(std::move(image)), Error);
  }
}

TEST(Flatten, TheSameBitsForAnyThreadsAndBands) {
  const DeepImage image = makeDeep(randomPixels(9, 400, 12), 20);
  const flat::Image whole = flatten(image);
  const DeepImage tidied = tidy(image.copy()).image;
  for (const size_t threads : {1, 2, 5}) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    EXPECT_TRUE(sameBits(flatten(image), whole));
    EXPECT_TRUE(sameBits(tidy(image.copy()).image, tidied));
  }
  for (int y = image.dataWindow.y0; y < image.dataWindow.y1; ++y) {
    const DeepImage band = rows(image, y, y + 1);
    EXPECT_TRUE(sameBits(tidy(band.copy()).image, rows(tidied, y, y + 1)));
    const flat::Image flat = flatten(band);
    const size_t first = size_t(y - image.dataWindow.y0) * 20;
    for (size_t c = 0; c < flat.planes.size(); ++c)
      EXPECT_TRUE(std::ranges::equal(flat.planes[c].values, std::span(whole.planes[c].values).subspan(first, 20)));
  }
}

TEST(Tidy, EmptyImages) {
  EXPECT_TRUE(isTidy(makeDeep({{}, {}}, 2)));
  EXPECT_EQ(tidy(makeDeep({{}, {}}, 2)).image.samples(), 0u);
  EXPECT_EQ(flatten(makeDeep({{}, {}}, 2)).get("R").values[1], 0);
}

}  // namespace
}  // namespace fathom::deep
