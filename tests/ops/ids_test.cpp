// Id mattes: every bit of a pixel's alpha belongs to one id, whatever lies in front of, in or at the same place as what.
#include "deep/ops/ids.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <map>

#include "base/error.h"
#include "deep/flatten.h"
#include "flat/io.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::deep {
namespace {

using reference::makeDeep;
using reference::randomSamples;

// Few ids, so that several samples of a pixel have the same; all bits are in use.
constexpr uint32_t kIds[] = {0, 1, 7, 0xdeadbeef, 0x7f800001, 0xffffffff, 0x3f800000};

DeepImage withFewIds(DeepImage image) {
  for (uint32_t& id : image.find("id")->ids) id = kIds[id % std::size(kIds)];
  return image;
}

std::vector<DeepImage> images() {
  std::vector<DeepImage> result;
  for (unsigned seed = 1; seed <= 20; ++seed)
    result.push_back(withFewIds(randomSamples(
        {.seed = seed, .volumes = seed % 2 == 0, .most = 9, .odd = seed % 5 == 0, .sorted = seed % 3 != 0})));
  return result;
}

// The coverage of one id in another way: its samples alone are white, the others black.
flat::Image whiteAlone(DeepImage image, uint32_t id) {
  for (size_t i = 0; i < image.samples(); ++i) {
    const float alpha = image.get("A")[i];
    image.get("R")[i] = image.find("id")->ids[i] == id && alpha > 0 ? std::min(alpha, 1.0f) : 0;
  }
  return flatten(image);
}

TEST(Ids, CoverageIsWhatFlatteningAWhiteIdGives) {
  unsigned seed = 0;
  for (const DeepImage& image : images()) {
    ++seed;
    for (const uint32_t id : kIds) {
      const flat::Image matte = idMatte(image, "id", {&id, 1}), white = whiteAlone(image.copy(), id);
      for (size_t p = 0; p < image.pixels(); ++p)
        ASSERT_NEAR(matte.get("A").values[p], white.get("R").values[p], 1e-6) << "seed " << seed << " pixel " << p;
    }
  }
}

TEST(Ids, CoveragesSumToAlpha) {
  for (const DeepImage& image : images()) {
    const flat::Image all = idMatte(image, "id", kIds), each = idMattes(image, "id", kIds), flat = flatten(image);
    for (size_t p = 0; p < image.pixels(); ++p) {
      double sum = 0;
      for (const flat::Plane& plane : each.planes) sum += double(plane.values[p]);
      ASSERT_NEAR(sum, flat.get("A").values[p], 1e-6);
      ASSERT_NEAR(all.get("A").values[p], flat.get("A").values[p], 1e-6);
    }
  }
}

TEST(Ids, CoincidentSamplesShareTheirCoverage) {
  const DeepImage image = makeDeep({{{1, 1, 0.5f, 0, 9}, {2, 3, 0.75f, 1, 7}, {2, 3, 0.5f, 1, 8}, {4, 4, 1, 1, 9}}}, 1);
  const std::vector<uint32_t> ids = {9, 7, 8, 8};
  const flat::Image each = idMattes(image, "id", ids);
  ASSERT_EQ(each.planes.size(), 3u);
  EXPECT_FLOAT_EQ(each.get("id.7").values[0], 0.5f * 0.875f * 2 / 3);  // optical depths 2 : 1
  EXPECT_FLOAT_EQ(each.get("id.8").values[0], 0.5f * 0.875f / 3);
  EXPECT_FLOAT_EQ(each.get("id.9").values[0], 0.5f + 0.5f * 0.125f);
}

TEST(Ids, RanksFallAndHoldEveryId) {
  for (const DeepImage& image : images()) {
    const RankedIds ranked = rankIds(image, "id", 7);
    ASSERT_EQ(ranked.image.planes.size(), 16u);
    ASSERT_LE(ranked.most, std::size(kIds));
    std::map<uint32_t, flat::Image> mattes;
    for (const uint32_t id : kIds) mattes.emplace(cryptomatteBits(id), idMatte(image, "id", {&id, 1}));
    for (size_t p = 0; p < image.pixels(); ++p) {
      float before = 1;
      size_t found = 0, expected = 0;
      for (size_t k = 0; k < 8; ++k) {
        const float coverage = ranked.image.planes[2 * k + 1].values[p];
        ASSERT_LE(coverage, before);
        before = coverage;
        const auto bits = std::bit_cast<uint32_t>(ranked.image.planes[2 * k].values[p]);
        if (bits == 0) continue;
        ++found;
        ASSERT_EQ(coverage, mattes.at(bits).get("A").values[p]);
      }
      for (const auto& [id, matte] : mattes) expected += matte.get("A").values[p] > 0;
      ASSERT_GE(found, expected);  // a coverage below the smallest float is an id yet
    }
  }
}

TEST(Ids, RanksKeepTheLargest) {
  const DeepImage image = makeDeep({{{1, 1, 0.1f, 0, 1}, {2, 2, 0.5f, 0, 2}, {3, 3, 1, 0, 3}}}, 1);
  const RankedIds ranked = rankIds(image, "id", 1);
  EXPECT_EQ(ranked.most, 3u);
  ASSERT_EQ(ranked.image.planes.size(), 4u);
  EXPECT_EQ(std::bit_cast<uint32_t>(ranked.image.get("id00.R").values[0]), 0x00800002u);
  EXPECT_FLOAT_EQ(ranked.image.get("id00.G").values[0], 0.45f);
  EXPECT_EQ(std::bit_cast<uint32_t>(ranked.image.get("id00.B").values[0]), 0x00800003u);
  EXPECT_FLOAT_EQ(ranked.image.get("id00.A").values[0], 0.45f);
}

TEST(Ids, WhatIsNotSeenHasNoRank) {
  const RankedIds ranked = rankIds(makeDeep({{{1, 1, 1, 0, 1}, {2, 2, 0.5f, 0, 2}}}, 1), "id", 2);
  EXPECT_EQ(ranked.most, 1u);
  EXPECT_EQ(std::bit_cast<uint32_t>(ranked.image.get("id00.B").values[0]), 0u);
}

TEST(Ids, NoStoredIdIsSubnormalOrNotFinite) {
  for (const uint32_t id : {0u, 1u, 0x007fffffu, 0x00800000u, 0x7f7fffffu, 0x7f800000u, 0x7fc00000u, 0xffffffffu,
                            0x80000000u, 0xdeadbeefu}) {
    EXPECT_TRUE(std::isnormal(std::bit_cast<float>(cryptomatteBits(id)))) << id;
    EXPECT_TRUE(cryptomatteBits(id) == id || cryptomatteBits(id) == (id ^ 0x00800000u)) << id;
  }
  EXPECT_EQ(cryptomatteBits(0xdeadbeef), 0xdeadbeefu);
}

TEST(Ids, ComeBackFromAFileBitForBit) {
  const TemporaryFolder folder;
  for (const bool half : {false, true})
    for (unsigned seed = 1; seed <= 3; ++seed) {
      DeepImage image = randomSamples({.seed = seed, .most = 9});
      const flat::Image ranked = rankIds(image, "id", 6).image;
      const std::string path = folder.path() + "/ids.exr";
      flat::write(path, ranked, {.half = half});
      const flat::Image read = flat::read(path);
      for (const flat::Plane& plane : ranked.planes)
        for (size_t p = 0; p < image.pixels(); ++p)
          ASSERT_EQ(std::bit_cast<uint32_t>(read.get(plane.name).values[p]), std::bit_cast<uint32_t>(plane.values[p]))
              << plane.name << " seed " << seed << " half " << half;
      for (const auto& [name, value] : ranked.attributes)
        EXPECT_TRUE(!name.starts_with("cryptomatte/") || read.attributes.at(name) == value) << name;
    }
}

TEST(Ids, MetadataIsWhatTheSpecificationHas) {
  DeepImage image = makeDeep({{{1, 1, 1, 1, 5}}}, 1);
  image.add("hello", PixelType::Uint).ids.fill(5);  // MurmurHash3 x86 32 of "hello" is 248bfa47
  image.attributes.set("cryptomatte/248bfa4/manifest", std::string("{\"hero\":\"00800005\"}"));
  image.attributes.set("cryptomatte/1234567/name", std::string("another"));
  const auto attributes = rankIds(image, "hello", 2).image.attributes;
  EXPECT_EQ(attributes.at("cryptomatte/248bfa4/name"), "hello");
  EXPECT_EQ(attributes.at("cryptomatte/248bfa4/hash"), "MurmurHash3_32");
  EXPECT_EQ(attributes.at("cryptomatte/248bfa4/conversion"), "uint32_to_float32");
  EXPECT_EQ(attributes.at("cryptomatte/248bfa4/manifest"), "{\"hero\":\"00800005\"}");
  EXPECT_FALSE(attributes.contains("cryptomatte/1234567/name"));
}

TEST(Ids, SaysWhichChannelsHaveIds) {
  const DeepImage image = makeDeep({{{1, 1, 1, 1, 5}}}, 1);
  for (const char* name : {"R", "object"}) {
    try {
      idMatte(image, name, kIds);
      FAIL() << "expected an error";
    } catch (const Error& e) {
      EXPECT_THAT(e.what(), testing::HasSubstr(std::string("channel ") + name));
      EXPECT_THAT(e.what(), testing::HasSubstr("channels with ids: id"));
    }
  }
  EXPECT_THROW(rankIds(image, "id", 0), Error);
}

TEST(Ids, OfBandsAreThoseOfTheImage) {
  const DeepImage image = withFewIds(randomSamples({.seed = 4, .volumes = true, .most = 9, .sorted = false}));
  const flat::Image whole = rankIds(image, "id", 6).image;
  const size_t width = size_t(image.dataWindow.width());
  for (int y = image.dataWindow.y0; y < image.dataWindow.y1; ++y) {
    const flat::Image band = rankIds(rows(image, y, y + 1), "id", 6).image;
    for (size_t c = 0; c < band.planes.size(); ++c)
      for (size_t x = 0; x < width; ++x)
        EXPECT_EQ(std::bit_cast<uint32_t>(band.planes[c].values[x]),
                  std::bit_cast<uint32_t>(whole.planes[c].values[size_t(y - image.dataWindow.y0) * width + x]));
  }
  EXPECT_EQ(rankIds(rows(image, image.dataWindow.y0, image.dataWindow.y0), "id", 6).image.planes.size(), 12u);
}

}  // namespace
}  // namespace fathom::deep
