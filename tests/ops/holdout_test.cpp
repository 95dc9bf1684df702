// Holding out: what is seen of each image in the merge of both, by the equation of transfer.
#include "deep/ops/holdout.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "base/error.h"
#include "deep/clip.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "deep/ops/crop.h"
#include "deep/ops/merge.h"
#include "deep/tidy.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/radiative.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::integrate;
using reference::makeDeep;
using reference::mediaOf;
using reference::Radiance;
using reference::randomSamples;
using reference::samplesOf;
using reference::together;

DeepImage randomImage(unsigned seed, bool odd = false) {
  return randomSamples({.seed = seed, .volumes = seed % 3 != 0, .most = 8, .odd = odd, .sorted = seed % 4 != 1});
}

// Every alpha that a float can hold on the way from 1e-30 over 1 - 2^-24 to 1.
DeepImage nearlyOpaque(unsigned seed) {
  DeepImage image = randomImage(seed);
  std::mt19937 random(seed);
  for (float& alpha : image.get("A"))
    if (random() % 4 == 0) alpha = 1 - std::pow(2.0f, -float(random() % 25));
  return image;
}

TEST(Holdout, IsWhatTheEquationOfTransferShowsOfTheImage) {
  for (unsigned seed = 1; seed <= 60; ++seed) {
    const DeepImage image = nearlyOpaque(seed), other = nearlyOpaque(seed + 1000);
    const flat::Image flat = flatten(holdout(image.copy(), other));
    for (size_t p = 0; p < image.pixels(); ++p) {
      const Radiance seen = integrate(together(mediaOf(image, p), mediaOf(other, p, "R", 1)), 2);
      ASSERT_NEAR(flat.get("R").values[p], seen.light[0], 1e-5) << "pixel " << p << ", seed " << seed;
      ASSERT_NEAR(flat.get("A").values[p], seen.alpha[0], 1e-5) << "pixel " << p << ", seed " << seed;
    }
  }
}

TEST(Holdout, IsRightUpToEveryDepthWhereASampleBeginsOrEnds) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const DeepImage image = randomImage(seed), other = randomImage(seed + 1000);
    const DeepImage held = holdout(image.copy(), other);
    for (size_t p = 0; p < image.pixels(); ++p) {
      const auto media = together(mediaOf(image, p), mediaOf(other, p, "R", 1));
      for (const auto& border : mediaOf(held, p))
        for (const double z : {border.z, border.zBack}) {
          const Radiance seen = integrate(media, 2, z), found = integrate(mediaOf(held, p), 1, z);
          ASSERT_NEAR(found.light[0], seen.light[0], 1e-5) << "pixel " << p << " at " << z << ", seed " << seed;
          ASSERT_NEAR(found.alpha[0], seen.alpha[0], 1e-5) << "pixel " << p << " at " << z << ", seed " << seed;
        }
    }
  }
}

TEST(Holdout, OfEachByTheOtherMakesTheMerge) {
  for (unsigned seed = 1; seed <= 60; ++seed) {
    std::vector<DeepImage> both;
    both.push_back(randomImage(seed, true));
    both.push_back(randomImage(seed + 1000, true));
    const flat::Image whole = flatten(merge(both));
    const flat::Image first = flatten(holdout(both[0].copy(), both[1])),
                      second = flatten(holdout(both[1].copy(), both[0]));
    for (const char* name : {"R", "G", "B", "A"})
      for (size_t p = 0; p < both[0].pixels(); ++p)
        ASSERT_NEAR(first.get(name).values[p] + second.get(name).values[p], whole.get(name).values[p], 1e-5)
            << name << " of pixel " << p << ", seed " << seed;
  }
}

TEST(Holdout, OnAFrameOfVolumesAgreesWithTheEquationOfTransfer) {
  const std::string path = FATHOM_SHARED "/real/representativeDeepImage.exr";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path;
  const DeepImage image = read(path);
  DeepImage other = image.copy();  // moved by half a volume, and by some pixels
  for (const char* name : {"Z", "ZBack"})
    for (float& z : other.get(name)) z += 0.37f;
  other.dataWindow = {image.dataWindow.x0 + 9, image.dataWindow.y0, image.dataWindow.x1 + 9, image.dataWindow.y1};
  const flat::Image flat = flatten(holdout(image.copy(), other));
  for (size_t p = 0; p < image.pixels(); p += 11) {
    const int x = image.dataWindow.x0 + int(p % size_t(image.dataWindow.width()));
    const int y = image.dataWindow.y0 + int(p / size_t(image.dataWindow.width()));
    auto media = mediaOf(image, p);
    if (other.dataWindow.contains(x, y)) media = together(media, mediaOf(other, other.dataWindow.index(x, y), "R", 1));
    const Radiance seen = integrate(media, 2);
    ASSERT_NEAR(flat.get("R").values[p], seen.light[0], 1e-5 * std::max(1.0, seen.light[0])) << "pixel " << p;
    ASSERT_NEAR(flat.get("A").values[p], seen.alpha[0], 1e-5) << "pixel " << p;
  }
}

TEST(Holdout, ByAnOpaqueThingRemovesWhatIsBehind) {
  const DeepImage image = makeDeep({{{1, 1, 0.5f, 0.1f, 7}, {2, 6, 0.75f, 0.3f, 8}, {7, 7, 1, 0.3f, 9}}}, 1);
  const DeepImage other = makeDeep({{{4, 4, 1, 0, 1}}}, 1);
  const auto held = samplesOf(holdout(image.copy(), other), 0);
  ASSERT_EQ(held.size(), 2u);
  EXPECT_EQ(held[0].id, 7u);
  EXPECT_EQ(held[0].colour, 0.1f);
  EXPECT_EQ(held[1].id, 8u);
  EXPECT_EQ(held[1].zBack, 4);
  EXPECT_FLOAT_EQ(held[1].alpha, 0.5f);
  EXPECT_FLOAT_EQ(held[1].colour, 0.2f);
}

TEST(Holdout, OpaqueThingsAtTheSameDepthShareIt) {
  const DeepImage image = makeDeep({{{3, 3, 1, 0.8f, 7}}}, 1), other = makeDeep({{{3, 3, 1, 0, 1}}}, 1);
  const auto held = samplesOf(holdout(image.copy(), other), 0);
  ASSERT_EQ(held.size(), 1u);
  EXPECT_EQ(held[0].alpha, 0.5f);
  EXPECT_EQ(held[0].colour, 0.4f);
  EXPECT_TRUE(samplesOf(holdout(makeDeep({{{3, 3, 0.5f, 0.8f, 7}}}, 1), other), 0).empty());
}

TEST(Holdout, EmissionIsAttenuatedAndHidesNothing) {
  const DeepImage fire = makeDeep({{{3, 5, 0, 0.8f, 7}}}, 1), smoke = makeDeep({{{1, 2, 0.75f, 0, 1}}}, 1);
  const auto held = samplesOf(holdout(fire.copy(), smoke), 0);
  ASSERT_EQ(held.size(), 1u);
  EXPECT_EQ(held[0].alpha, 0);
  EXPECT_FLOAT_EQ(held[0].colour, 0.2f);
  EXPECT_EQ(reference::difference(holdout(smoke.copy(), fire), smoke), "");
}

TEST(Holdout, WithoutAnythingInFrontPassesBitForBit) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomImage(seed, true);
    for (const Box& window : {Box{}, Box{100, 0, 104, 9}})
      EXPECT_EQ(reference::difference(holdout(image.copy(), randomSamples({.window = window})), image), "");
    DeepImage far = randomImage(seed + 7, false);
    far.erase("ZBack");
    far.get("Z");
    for (float& z : far.get("Z")) z += 1000;
    DeepImage near = image.copy();
    for (float& z : near.get("Z"))
      if (!std::isfinite(z)) z = 1;
    EXPECT_EQ(reference::difference(holdout(near.copy(), far), near), "") << "seed " << seed;
    EXPECT_EQ(holdout(randomSamples({.window = {}}), image).samples(), 0u);
  }
}

TEST(Holdout, EverySampleKeepsAnIdOfItsPixel) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const DeepImage image = randomImage(seed, true), held = holdout(image.copy(), randomImage(seed + 50, true));
    for (size_t p = 0; p < image.pixels(); ++p)
      for (size_t s = held.offsets[p]; s < held.offsets[p + 1]; ++s) {
        const auto& ids = image.find("id")->ids;
        ASSERT_NE(
            std::find(ids.begin() + image.offsets[p], ids.begin() + image.offsets[p + 1], held.find("id")->ids[s]),
            ids.begin() + image.offsets[p + 1])
            << "seed " << seed;
      }
  }
}

TEST(Holdout, IsTheSameForAnyBandOfRows) {
  DeepImage image = randomImage(5, true);
  const DeepImage other = randomImage(6, true);
  for (const char* name : {"variance.R", "samples", "half0.R"}) image.add(name, PixelType::Float).values.fill(1);
  const DeepImage whole = holdout(image.copy(), other);
  EXPECT_FALSE(whole.find("variance.R"));
  for (int y = image.dataWindow.y0; y < image.dataWindow.y1; ++y)
    EXPECT_EQ(reference::difference(holdout(rows(image, y, y + 1), rows(other, y, y + 1)), rows(whole, y, y + 1)), "");
}

TEST(Holdout, ThousandsOfSamplesInOnePixel) {
  const Box one{0, 0, 1, 1};
  unsigned seed = 1;
  DeepImage image = randomSamples({.window = one, .seed = seed, .most = 4000}), other = image.copy();
  while (image.samples() < 1000) image = randomSamples({.window = one, .seed = ++seed, .most = 4000});
  while (other.samples() < 1000) other = randomSamples({.window = one, .seed = ++seed, .volumes = true, .most = 4000});
  const Radiance seen = integrate(together(mediaOf(image, 0), mediaOf(other, 0, "R", 1)), 2);
  EXPECT_NEAR(flatten(holdout(image.copy(), other)).get("A").values[0], seen.alpha[0], 1e-5);
}

TEST(HardHoldout, KeepsOrRemovesWholeSamples) {
  const DeepImage image =
      makeDeep({{{1, 1, 0.5f, 0.1f, 7}, {2, 9, 0.5f, 0.2f, 8}, {4, 4, 0.5f, 0.2f, 9}, {5, 5, 1, 0.3f, 10}}}, 1);
  const DeepImage other = makeDeep({{{3, 3, 0.4f, 0, 1}, {4, 4, 0.2f, 0, 1}, {6, 6, 1, 0, 1}}}, 1);
  const auto ids = [&](double opaque) {
    std::vector<uint32_t> found;
    for (const auto& sample : samplesOf(hardHoldout(image, other, opaque), 0)) found.push_back(sample.id);
    return found;
  };
  EXPECT_EQ(ids(0.4), (std::vector<uint32_t>{7, 8}));
  EXPECT_EQ(ids(0.5), (std::vector<uint32_t>{7, 8, 9}));
  EXPECT_EQ(ids(1), (std::vector<uint32_t>{7, 8, 9, 10}));
  EXPECT_THROW(ids(0), Error);
  EXPECT_THROW(ids(1.5), Error);
}

TEST(HardHoldout, AVolumeHidesFromTheDepthWhereItIsOpaqueEnough) {
  const DeepImage other = makeDeep({{{2, 6, 0.75f, 0, 1}}}, 1);  // half of the light passes up to 4
  for (const auto& [z, stays] : {std::pair{3.99f, true}, {4.0f, false}, {4.01f, false}}) {
    const DeepImage image = makeDeep({{{z, z, 1, 0.5f, 1}}}, 1);
    EXPECT_EQ(hardHoldout(image, other, 0.5).samples() == 1, stays) << z;
  }
}

TEST(HardHoldout, ThickVolumesTogetherHideFromTheDepthWhereTheyAreOpaqueEnough) {
  const float thick = 1 - 0x1p-24f;  // an optical depth of 24 log 2 each; the three together round to an alpha of 1
  const DeepImage other = makeDeep({{{1, 37, thick, 0, 1}, {1, 37, thick, 0, 1}, {1, 37, thick, 0, 1}}}, 1);
  for (const auto& [z, stays] : {std::pair{1.49f, true}, {1.51f, false}}) {
    const DeepImage image = makeDeep({{{z, z, 1, 0.5f, 1}}}, 1);
    EXPECT_EQ(hardHoldout(image, other, 0.5).samples() == 1, stays) << z;
  }
}

TEST(HardHoldout, WhatIsOpaqueByRoundingHidesFromItsBack) {
  const float thick = 1 - 0x1p-24f;
  const DeepImage other = makeDeep({{{1, 37, thick, 0, 1}, {1, 37, thick, 0, 1}, {1, 37, thick, 0, 1}}}, 1);
  for (const auto& [z, stays] : {std::pair{30.0f, true}, {37.0f, false}, {38.0f, false}}) {
    const DeepImage image = makeDeep({{{z, z, 1, 0.5f, 1}}}, 1);
    EXPECT_EQ(hardHoldout(image, other, 1).samples() == 1, stays) << z;
  }
}

TEST(HardHoldout, AnOpaqueVolumeHidesFromItsFront) {
  const DeepImage other = makeDeep({{{2, 6, 1, 0, 1}}}, 1);
  for (const double opaque : {0.5, 1.0})
    for (const auto& [z, stays] : {std::pair{2.0f, true}, {2.01f, false}}) {
      const DeepImage image = makeDeep({{{z, z, 1, 0.5f, 1}}}, 1);
      EXPECT_EQ(hardHoldout(image, other, opaque).samples() == 1, stays) << z << ", " << opaque;
    }
}

TEST(HardHoldout, AnAlphaThatIsAskedForIsReachedByOneThatIsWritten) {
  const DeepImage image = makeDeep({{{2, 2, 1, 0.5f, 1}}}, 1);
  for (int i = 1; i <= 99; ++i) {
    const double opaque = i / 100.0;
    EXPECT_EQ(hardHoldout(image, makeDeep({{{1, 1, float(opaque), 0, 1}}}, 1), opaque).samples(), 0u) << opaque;
    EXPECT_EQ(hardHoldout(image, makeDeep({{{1, 2, float(opaque), 0, 1}}}, 1), opaque).samples(), 0u) << opaque;
  }
}

TEST(HardHoldout, KeepsThoseThatTheEquationOfTransferDoes) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    DeepImage image = randomImage(seed);
    const DeepImage other = randomImage(seed + 1000);
    image.add("samples", PixelType::Float).values.fill(1);
    const DeepImage held = hardHoldout(image, other, 0.5);
    EXPECT_TRUE(held.find("samples"));
    for (size_t p = 0; p < image.pixels(); ++p) {
      size_t stay = 0, unsure = 0;
      for (const auto& sample : mediaOf(image, p)) {
        const double inFront = integrate(mediaOf(other, p), 1, sample.z).totalAlpha();
        stay += inFront < 0.5;
        unsure += std::abs(inFront - 0.5) < 1e-6;
      }
      ASSERT_NEAR(double(held.count(p)), double(stay), double(unsure)) << "pixel " << p << ", seed " << seed;
    }
  }
}

// Plain channels are means over a piece's samples: those of the image alone.
TEST(Holdout, PlainChannelsAreThoseOfTheImage) {
  DeepImage image = makeDeep({{{1, 3, 0.5f, 0.1f, 7}}}, 1);
  image.add("coc", PixelType::Float).values.fill(5);
  const DeepImage held = holdout(std::move(image), makeDeep({{{2, 4, 0.5f, 0, 1}}}, 1));
  ASSERT_EQ(held.samples(), 2u);
  for (const float coc : held.get("coc")) EXPECT_FLOAT_EQ(coc, 5);
}

TEST(Holdout, PlainChannelsOfEmissionStay) {
  DeepImage fire = makeDeep({{{3, 5, 0, 0.8f, 7}}}, 1);
  fire.add("coc", PixelType::Float).values.fill(5);
  const DeepImage held = holdout(std::move(fire), makeDeep({{{1, 4, 0.75f, 0, 1}}}, 1));
  ASSERT_EQ(held.samples(), 2u);
  for (const float coc : held.get("coc")) EXPECT_EQ(coc, 5);
}

TEST(HoldoutMatte, IsThePartOfAlphaThatIsSeen) {
  const DeepImage image = randomImage(2), other = randomImage(4);
  const flat::Image matte = holdoutMatte(image, other), held = flatten(holdout(image.copy(), other));
  const flat::Image flat = flatten(image);
  ASSERT_EQ(matte.planes.size(), 1u);
  for (size_t p = 0; p < image.pixels(); ++p) {
    const float part = matte.get("A").values[p];
    EXPECT_NEAR(part * flat.get("A").values[p], held.get("A").values[p], 1e-6);
    EXPECT_TRUE(image.count(p) > 0 || part == 1);
    EXPECT_LE(part, 1);
  }
}

// Also where what is seen is rounded up and the whole down.
TEST(HoldoutMatte, IsNeverMoreThanOne) {
  for (unsigned seed = 1; seed <= 200; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true, .most = 8});
    DeepImage other = randomSamples({.seed = seed + 1000, .volumes = true});
    for (float& alpha : other.get("A")) alpha = 1e-9f;
    const flat::Image matte = holdoutMatte(image, other);
    for (const float part : matte.get("A").values) ASSERT_LE(part, 1) << "seed " << seed;
  }
}

}  // namespace
}  // namespace fathom::deep
