#include "deep/assemble.h"

#include <gmock/gmock.h>

#include <random>
#include <string>
#include <vector>

#include "base/error.h"
#include "deep/alpha.h"
#include "deep/one_bin.h"

namespace fathom::deep {
namespace {

using testing::ElementsAre;
using testing::FloatNear;
using testing::Pointwise;

struct Bin {
  float z, alpha, value;  // value: of one channel, premultiplied
};

// An image of one row at (0, 0); the channels named hold `value`.
DeepImage makeRow(const std::vector<std::vector<Bin>>& pixels, const std::vector<std::string>& channels, int x0 = 0) {
  const int width = int(pixels.size());
  DeepImage image{{x0, 0, x0 + width, 1}, {0, 0, 8, 1}, Buffer<uint64_t>(pixels.size() + 1, 0), {}, {}};
  for (size_t i = 0; i < pixels.size(); ++i) image.offsets[i + 1] = image.offsets[i] + pixels[i].size();
  const auto fill = [&](const std::string& name, float Bin::*member) {
    Buffer<float>& values = image.add(name, PixelType::Float).values;
    size_t i = 0;
    for (const auto& pixel : pixels)
      for (const Bin& bin : pixel) values[i++] = bin.*member;
  };
  fill("Z", &Bin::z);
  fill("A", &Bin::alpha);
  for (const std::string& name : channels) fill(name, &Bin::value);
  return image;
}

std::vector<float> valuesOf(const DeepImage& image, const std::string& name) {
  const std::span<const float> values = image.get(name);
  return {values.begin(), values.end()};
}

TEST(AddFeatures, TheSameBinsGetTheSameBits) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> uniform(0.01f, 1.0f);
  std::vector<std::vector<Bin>> pixels(50);
  for (auto& pixel : pixels) {
    float z = 1;
    for (size_t i = random() % 6; i > 0; --i) pixel.push_back({z += uniform(random), uniform(random), uniform(random)});
  }
  DeepImage image = makeRow(pixels, {"R"});
  const DeepImage features = makeRow(pixels, {"albedo.R", "N.X", "variance.albedo.R", "other"});
  addFeatures(image, features);
  EXPECT_EQ(valuesOf(image, "albedo.R"), valuesOf(features, "albedo.R"));
  EXPECT_EQ(valuesOf(image, "N.X"), valuesOf(features, "N.X"));
  EXPECT_THAT(valuesOf(image, "variance.albedo.R"), Pointwise(FloatNear(1e-6f), valuesOf(features, "albedo.R")));
  EXPECT_FALSE(image.find("other"));
}

TEST(AddFeatures, OtherBinsGoToTheNearest) {
  DeepImage image = makeRow({{{1, 0.5f, 0}, {5, 1, 0}}, {{3, 0.25f, 0}}, {}}, {"R"});
  // Two samples come to the first bin with effective alphas 0.2 and 0.4, none to the second.
  const DeepImage features = makeRow({{{0.9f, 0.2f, 0.1f}, {1.2f, 0.5f, 0.5f}}, {}, {{1, 1, 1}}}, {"albedo.R"});
  addFeatures(image, features);
  const float mean = (0.2f * 0.5f + 0.4f * 1.0f) / 0.6f;
  EXPECT_THAT(valuesOf(image, "albedo.R"), Pointwise(FloatNear(1e-6f), std::vector<float>{mean * 0.5f, 1.0f, 0.0f}));
}

TEST(AddFeatures, FlatOnesFlattenToWhatTheyWere) {
  DeepImage image = makeRow({{{1, 0.5f, 0}, {2, 0.5f, 0}}, {{1, 0.25f, 0}}}, {"R"});
  flat::Image features{{0, 0, 2, 1}, {0, 0, 2, 1}, {}, {}};
  features.add("albedo.R", 0.3f);
  features.add("variance.albedo.R", 0.01f);
  addFeatures(image, features);
  const Buffer<float> share = effectiveAlpha(image);
  const std::vector<float> albedo = valuesOf(image, "albedo.R");
  EXPECT_NEAR(albedo[0] + 0.5f * albedo[1], 0.3f, 1e-6f);
  EXPECT_NEAR(albedo[2], 0.3f, 1e-6f);
  // A third of the pixel's samples: three times the variance of the mean.
  EXPECT_THAT(valuesOf(image, "variance.albedo.R"),
              Pointwise(FloatNear(1e-6f), std::vector<float>{0.015f, 0.03f, 0.01f}));

  // Where the flat file has an alpha of its own, that is what its values were multiplied with.
  features.add("A", 0.6f);
  addFeatures(image, features);
  EXPECT_THAT(valuesOf(image, "albedo.R"), Pointwise(FloatNear(1e-6f), std::vector<float>{0.25f, 0.25f, 0.125f}));
}

TEST(AddHalf, SamplesAreCountedWhereTheyCome) {
  DeepImage image = makeRow({{{1, 0.5f, 1}, {5, 1, 1}}, {{3, 0.5f, 1}}}, {"R", "diffuse.R"});
  const DeepImage half = makeRow({{{1.5f, 0.25f, 0.5f}, {4, 1.0f, 2.0f}}, {}}, {"R", "diffuse.R", "N.X"});
  addHalf(image, half, 1, 8);
  EXPECT_THAT(valuesOf(image, "half1.R"), ElementsAre(1.0f, 2.0f, 0.0f));  // 0.5 / 0.25 * 0.5, 2 / 1 * 1
  EXPECT_THAT(valuesOf(image, "half1.diffuse.R"), ElementsAre(1.0f, 2.0f, 0.0f));
  EXPECT_THAT(valuesOf(image, "half1.samples"), ElementsAre(2.0f, 6.0f, 0.0f));
  EXPECT_FALSE(image.find("half1.N.X"));

  DeepImage counted = half.copy();
  counted.add("samples", PixelType::Float).values.fill(3);
  addHalf(image, counted, 0, 8);
  EXPECT_THAT(valuesOf(image, "half0.samples"), ElementsAre(3.0f, 3.0f, 0.0f));
}

TEST(AddHalf, ASampleWithoutAlphaHasNoSay) {
  DeepImage image = makeRow({{{1, 0.5f, 1}}}, {"R"});
  addHalf(image, makeRow({{{1, 0, 7}, {2, 0.5f, 0.25f}}}, {"R"}), 0, 4);
  EXPECT_THAT(valuesOf(image, "half0.R"), ElementsAre(0.25f));
  EXPECT_THAT(valuesOf(image, "half0.samples"), ElementsAre(2.0f));
}

TEST(ReplaceAlpha, BinsGetTheSharesOfTheOtherImage) {
  DeepImage image = makeRow({{{1, 0.5f, 0.5f}, {5, 1, 0.25f}}, {{2, 0.5f, 1}}}, {"R", "half0.R", "variance.R"});
  const DeepImage better = makeRow({{{0.8f, 0.2f, 0}, {1.1f, 0.25f, 0}, {5.2f, 0.5f, 0}}}, {});
  replaceAlpha(image, better);
  // Shares 0.2 + 0.2 and 0.3: alphas 0.4 and 0.3 / 0.6. The second pixel is outside the other image.
  EXPECT_THAT(valuesOf(image, "A"), Pointwise(FloatNear(1e-6f), std::vector<float>{0.4f, 0.5f, 0.5f}));
  EXPECT_THAT(valuesOf(image, "R"), Pointwise(FloatNear(1e-6f), std::vector<float>{0.4f, 0.125f, 1}));
  EXPECT_THAT(valuesOf(image, "half0.R"), Pointwise(FloatNear(1e-6f), std::vector<float>{0.4f, 0.125f, 1}));
  EXPECT_THAT(valuesOf(image, "variance.R"), ElementsAre(0.5f, 0.25f, 1.0f));
}

TEST(ReplaceAlpha, ItsOwnAlphasChangeNothing) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(0.0f, 1.0f);
  std::vector<std::vector<Bin>> pixels(200);
  for (auto& pixel : pixels) {
    float z = 1;
    for (size_t i = random() % 5; i > 0; --i) pixel.push_back({z += 0.1f + uniform(random), uniform(random), 1});
    if (!pixel.empty() && random() % 2) pixel.back().alpha = 1;
  }
  const DeepImage before = makeRow(pixels, {"R"});
  DeepImage after = before.copy();
  replaceAlpha(after, before);
  // By their shares of the pixel: what stands behind a nearly opaque bin is known less well.
  const Buffer<float> expected = effectiveAlpha(before), found = effectiveAlpha(after);
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(found[i], expected[i], 2e-7f) << i;
}

TEST(ReplaceAlpha, ABinThatNothingComesToIsEmpty) {
  DeepImage image = makeRow({{{1, 1, 0.5f}, {9, 0.5f, 0.5f}}}, {"R"});
  replaceAlpha(image, makeRow({{{1, 1, 0}}}, {}));
  EXPECT_THAT(valuesOf(image, "A"), ElementsAre(1.0f, 0.0f));
  EXPECT_THAT(valuesOf(image, "R"), ElementsAre(0.5f, 0.0f));
}

TEST(Features, AreThoseOfTheSurfaceAndTheirNoise) {
  for (const char* name :
       {"albedo.R", "N.X", "variance.albedo.G", "variance.N.Z", "variance.Z", "half0.albedo.B", "half1.albedo.B"})
    EXPECT_TRUE(isFeature(name)) << name;
  for (const char* name : {"R", "Z", "variance.R", "half0.R", "half1.N.X", "diffuse.R", "albedo", "variance.ZBack"})
    EXPECT_FALSE(isFeature(name)) << name;
}

TEST(AddFeatures, TheMiddleOfAVolumeStandsForIt) {
  const auto withBacks = [](DeepImage image, const std::vector<float>& backs) {
    std::ranges::copy(backs, image.add("ZBack", PixelType::Float).values.begin());
    return image;
  };
  // The first sample begins nearer to the first bin, and its middle, 3.5, is nearer to the second's, 4.
  DeepImage image = withBacks(makeRow({{{1, 1, 0}, {2, 1, 0}}}, {}), {1, 6});
  const DeepImage features = withBacks(makeRow({{{0.5f, 0.5f, 0.25f}, {6, 0.5f, 0.5f}}}, {"albedo.R"}), {6.5f, 6});
  addFeatures(image, features);
  // The second bin takes both, with effective alphas of 0.5 and 0.25; the first has the nearest one.
  EXPECT_THAT(valuesOf(image, "albedo.R"),
              Pointwise(FloatNear(1e-6f), std::vector<float>{0.5f, (0.5f * 0.5f + 0.25f * 1) / 0.75f}));
}

TEST(AddFeatures, TheNearestTakesTheAlphaOfTheBin) {
  DeepImage image = makeRow({{{1, 0.5f, 0}, {5, 0.25f, 0}}}, {});
  addFeatures(image, makeRow({{{1, 0.5f, 0.3f}}}, {"albedo.R"}));
  EXPECT_THAT(valuesOf(image, "albedo.R"), Pointwise(FloatNear(1e-6f), std::vector<float>{0.3f, 0.15f}));
}

TEST(AddFeatures, VariancesAreThoseOfTheMean) {
  DeepImage image = makeRow({{{1, 0.5f, 0}, {5, 1, 0}}}, {});
  const DeepImage features = makeRow({{{0.9f, 0.2f, 0.1f}, {1.2f, 0.5f, 0.5f}}}, {"variance.Z"});
  addFeatures(image, features);
  const float mean = (0.2f * 0.2f * 0.1f + 0.4f * 0.4f * 0.5f) / (0.6f * 0.6f);
  EXPECT_THAT(valuesOf(image, "variance.Z"), Pointwise(FloatNear(1e-6f), std::vector<float>{mean, 0.5f}));
}

TEST(AddFeatures, FlatOnesAreFoundByTheirPlace) {
  DeepImage image = makeRow({{{1, 1, 0}}, {{1, 0.5f, 0}}, {{1, 1, 0}}}, {});
  flat::Image features{{-1, -3, 2, 2}, {0, 0, 8, 8}, {}, {}};
  Buffer<float>& values = features.add("N.X").values;
  for (size_t i = 0; i < values.size(); ++i) values[i] = float(i);
  addFeatures(image, features);
  // Row 0 is the fourth of three columns; the third pixel is outside.
  EXPECT_THAT(valuesOf(image, "N.X"), ElementsAre(10.0f, 11.0f, 0.0f));
}

TEST(AddFeatures, FlatOnesAreNothingWhereNothingIsSeen) {
  DeepImage image = makeRow({{{1, 1, 0}, {2, 0.5f, 0}}, {{1, 0, 0}}}, {});
  flat::Image features{{0, 0, 2, 1}, {0, 0, 2, 1}, {}, {}};
  features.add("albedo.R", 0.5f);
  features.add("variance.albedo.R", 0.25f);
  addFeatures(image, features);
  EXPECT_THAT(valuesOf(image, "albedo.R"), ElementsAre(0.5f, 0.25f, 0.0f));
  EXPECT_THAT(valuesOf(image, "variance.albedo.R"), ElementsAre(0.25f, 0.0f, 0.0f));
}

TEST(AddHalf, AllColoursComeAndNothingElse) {
  DeepImage image = makeRow({{{1, 1, 1}}}, {});
  const std::vector<std::string> colours = {"R", "G", "B", "diffuse.G", "specular.B", "albedo.R"};
  std::vector<std::string> all = colours;
  all.insert(all.end(), {"N.X", "variance.R", "Rest"});
  addHalf(image, makeRow({{{1, 1, 0.5f}}}, all), 0, 4);
  EXPECT_EQ(image.channels.size(), 2 + colours.size() + 1);  // with Z, A and the samples
  for (const std::string& name : colours) EXPECT_THAT(valuesOf(image, "half0." + name), ElementsAre(0.5f)) << name;
}

TEST(AddHalf, SamplesThatNobodySeesAreNotCounted) {
  DeepImage image = makeRow({{{1, 0.5f, 1}}}, {});
  addHalf(image, makeRow({{{1, 0, 5}, {2, 0.5f, 3}}}, {"samples"}), 0, 4);
  EXPECT_THAT(valuesOf(image, "half0.samples"), ElementsAre(3.0f));
}

TEST(ReplaceAlpha, ABinWithoutAlphaHasNoColour) {
  DeepImage image = makeRow({{{1, 0, 0.5f}, {5, 1, 0.25f}}}, {"R"});
  replaceAlpha(image, makeRow({{{1, 0.5f, 0}, {5, 1, 0}}}, {}));
  EXPECT_THAT(valuesOf(image, "A"), ElementsAre(0.5f, 1.0f));
  EXPECT_THAT(valuesOf(image, "R"), ElementsAre(0.0f, 0.25f));
}

TEST(Pairing, WindowsNeedNotAgree) {
  DeepImage image = makeRow({{{1, 1, 0}}, {{1, 1, 0}}}, {"R"});
  addFeatures(image, makeRow({{{1, 1, 0.5f}}, {{1, 1, 0.25f}}}, {"albedo.R"}, 1));
  EXPECT_THAT(valuesOf(image, "albedo.R"), ElementsAre(0.0f, 0.5f));
  addFeatures(image, makeRow({{{1, 1, 0.5f}}}, {"albedo.R"}, 7));
  EXPECT_THAT(valuesOf(image, "albedo.R"), ElementsAre(0.0f, 0.0f));
}

TEST(OneBin, ThereAndBack) {
  flat::Image image{{-1, 2, 3, 4}, {0, 0, 8, 8}, {}, {{"fathom:spp", "32"}}};
  image.add("R", 0.5f);
  image.add("A", 0.25f);
  DeepImage bins = fromFlat(image);
  makeOneBin(bins);
  EXPECT_EQ(bins.samples(), image.dataWindow.area());
  EXPECT_EQ(bins.attributes.getInt("fathom:spp"), 32);
  EXPECT_EQ(bins.get("A")[0], 1.0f);
  EXPECT_EQ(bins.get("Z")[0], 1.0f);
  EXPECT_EQ(bins.get("R")[0], 0.5f);
  unmakeOneBin(bins);
  const flat::Image back = toFlat(bins);
  EXPECT_EQ(back.dataWindow, image.dataWindow);
  EXPECT_EQ(back.planes.size(), 2u);
  EXPECT_EQ(back.get("A").values[0], 0.25f);
  EXPECT_EQ(back.get("R").values[0], 0.5f);
}

TEST(OneBin, OwnDepthStaysAndAnAlphaIsNotInvented) {
  flat::Image image{{0, 0, 2, 1}, {0, 0, 2, 1}, {}, {}};
  image.add("Z", 7.0f);
  DeepImage bins = fromFlat(image);
  makeOneBin(bins);
  EXPECT_EQ(bins.get("Z")[1], 7.0f);
  unmakeOneBin(bins);
  EXPECT_EQ(toFlat(bins).planes.size(), 1u);
  EXPECT_EQ(toFlat(bins).get("Z").values[1], 7.0f);
}

}  // namespace
}  // namespace fathom::deep
