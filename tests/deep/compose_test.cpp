// Parts of the deep filter by hand, on a pixel or two: the guides and what the gate is told.
#include "deep/compose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "deep/bin_mix.h"
#include "deep/feature_prefilter.h"

namespace fathom::deep {
namespace {

// Pixels beside one another with as many bins each, of the colour 1 and without halves.
struct Bins {
  Buffer<uint64_t> offsets;
  DenoiseData data;

  Bins(int width, int height, size_t each, float weight) {
    offsets = Buffer<uint64_t>(size_t(width) * size_t(height) + 1);
    for (size_t p = 0; p < offsets.size(); ++p) offsets[p] = p * each;
    data.width = width;
    data.height = height;
    data.offsets = offsets.data();
    data.weight = Buffer<float>(data.bins(), weight);
    data.count = Buffer<float>(data.bins(), 8.0f);
    data.components.push_back({"", false, Buffer<float>(8 * data.bins(), 0.0f), {}});
    for (size_t b = 0; b < data.bins(); ++b) setColour(b, 1);
  }
  void setColour(size_t bin, float colour) {
    float* to = data.components[0].data.data() + 8 * bin;
    std::fill_n(to, 3, colour * data.weight[bin]);
    to[3] = data.weight[bin];
  }
};

TEST(PixelGuides, VariancesOfBinsAddUpByTheirSquaredWeights) {
  Bins bins(1, 1, 2, 0.5f);
  bins.data.weight[1] = 0.25f;
  Feature feature;
  for (size_t c = 0; c < 3; ++c) {
    Buffer<float>& variance = bins.data.components[0].variance.emplace_back(2);
    variance[0] = 0.4f, variance[1] = 0.8f;
    feature.value.emplace_back(2, 1.0f);
    feature.variance.push_back(variance.copy());
  }
  const float sum = 0.25f * 0.4f + 0.0625f * 0.8f;
  const ComponentGuide colour = colourGuide(bins.data, bins.data.components[0], 2);
  EXPECT_FLOAT_EQ(colour.variance.value[0].row(0)[0], sum);
  const FeatureGuide mean = featureGuide(bins.data, feature, 2, Buffer<uint8_t>(1, 0));
  EXPECT_FLOAT_EQ(mean.variance.value[2].row(0)[0], sum / (0.75f * 0.75f));
}

TEST(PixelGuides, AnEdgeIsNoNoise) {
  Bins bins(9, 7, 1, 1);
  for (size_t b = 0; b < bins.data.bins(); ++b) bins.setColour(b, b % 9 < 4 ? 0.0f : 1.0f);
  const ComponentGuide guide = colourGuide(bins.data, bins.data.components[0], 2);
  for (int y = 0; y < 7; ++y)
    for (int x = 0; x < 9; ++x) EXPECT_EQ(guide.variance.value[0].row(y)[x], 0) << x << ", " << y;
}

TEST(PixelGuides, VariancesAreAtLeastHalfTheMeanAroundThem) {
  flat::Padded variance(9, 9, 2);
  for (int y = 0; y < 9; ++y)
    for (int x = 0; x < 9; ++x) variance.row(y)[x] = x == 4 && y == 4 ? 1.0f : 0.0f;
  prefilterVariance(variance, 9, 9);
  EXPECT_EQ(variance.row(4)[4], 1);
  EXPECT_NEAR(variance.row(2)[6], 0.5f / 25, 1e-7f);
  EXPECT_EQ(variance.row(4)[7], 0);
}

TEST(PixelVariance, IsOfOneCameraSample) {
  Bins bins(1, 1, 2, 0.5f);
  bins.data.count[0] = 4, bins.data.count[1] = 16;
  std::vector<ComponentGuide> guides(1);
  for (flat::Padded& plane : guides[0].variance.value) {
    plane = flat::Padded(1, 1, 0);
    plane.row(0)[0] = 1;
  }
  EXPECT_FLOAT_EQ(pixelVariance(bins.data, guides, {})[0][0][0], 1 / (0.25f / 4 + 0.25f / 16));
  guides[0].variance.value[1].row(0)[0] = 1e38f;
  EXPECT_TRUE(std::isfinite(pixelVariance(bins.data, guides, {})[0][1][0]));
}

// The halves 1 and 2 of half a bin each, whose alpha is a half.
struct Composed {
  Bins bins{1, 1, 1, 0.5f};
  DeepImage image{{0, 0, 1, 1}, {0, 0, 1, 1}, bins.offsets.copy(), {}, {}};
  Buffer<uint8_t> still{1, 0};
  std::vector<Buffer<float>> filtered;

  Composed() {
    bins.data.halves = true;
    float* data = bins.data.components[0].data.data();
    for (size_t h = 0; h < 2; ++h)
      for (size_t c = 0; c < 4; ++c) data[4 * h + c] = c == 3 ? 0.5f : 0.5f * float(h + 1);
    for (const char* name : {"R", "G", "B"}) image.add(name, PixelType::Float).values.fill(0.75f);
    image.add("A", PixelType::Float).values.fill(0.5f);
    filtered.emplace_back(3, 1.25f);
  }
  GateBin run() { return compose(image, bins.data, {.halves = true}, still, {}, filtered)[0]; }
};

TEST(Compose, TheHalvesTellTheVarianceOfOneCameraSample) {
  Composed pixel;
  const GateBin bin = pixel.run();
  EXPECT_FLOAT_EQ(bin.filtered[0], 1.25f);
  EXPECT_FLOAT_EQ(bin.residual[0], 0.25f);
  EXPECT_FLOAT_EQ(bin.variance[0], 0.5f * 0.5f * 8);
  EXPECT_EQ(bin.samples, 8);
}

TEST(Compose, WhatIsNotFiniteHasNoSay) {
  Composed pixel;
  pixel.image.get("G")[0] = std::numeric_limits<float>::quiet_NaN();
  const GateBin bin = pixel.run();
  EXPECT_EQ(bin.samples, 0);
  for (size_t c = 0; c < 3; ++c) EXPECT_EQ(bin.residual[c], 0);
}

// Bins side by side, each the only one of its pixel: a first and a second estimate, and what is noisy.
struct Mixed {
  Bins bins;
  Buffer<GateBin> gated;
  Buffer<float> second;

  Mixed(const std::vector<std::array<float, 3>>& estimates, float prior = 0.5f, float samples = 4)
      : bins(int(estimates.size()), 1, 1, 1) {
    bins.data.depth.value.emplace_back(estimates.size(), 0.0f);
    gated = Buffer<GateBin>(estimates.size(), {});
    second = Buffer<float>(3 * estimates.size());
    for (size_t b = 0; b < gated.size(); ++b) {
      const auto [first, other, noisy] = estimates[b];
      gated[b].samples = samples;
      for (size_t c = 0; c < 3; ++c)
        gated[b].filtered[c] = first, gated[b].residual[c] = noisy - first, second[3 * b + c] = other;
    }
    mixBins(bins.data, {second.data(), second.size()}, Buffer<uint8_t>(gated.size(), 0), 0.5f, prior, gated);
  }
};

TEST(BinMix, WhereNothingTellsItIsThePrior) {
  for (const float prior : {0.25f, 0.6f}) EXPECT_FLOAT_EQ(Mixed({{1, 2, 1}}, prior, 0).gated[0].filtered[0], 2 - prior);
}

TEST(BinMix, TakesTheEstimateThatTheNoisyBinsSay) {
  EXPECT_FLOAT_EQ(Mixed({{1, 2, 1}}).gated[0].filtered[0], 1);
  const GateBin second = Mixed({{1, 2, 2}}).gated[0];
  EXPECT_FLOAT_EQ(second.filtered[0], 2);
  EXPECT_FLOAT_EQ(second.residual[0], 0);
  EXPECT_EQ(Mixed({{1, std::numeric_limits<float>::quiet_NaN(), 2}}).gated[0].filtered[0], 1);
}

// Two bins of the same mean of both estimates are alike, and say the opposite.
TEST(BinMix, BinsOfTheSameMeanAreAlike) {
  const float reach = std::exp(-0.2f), share = reach / (1 + reach);
  EXPECT_NEAR(Mixed({{1, 3, 3}, {3, 1, 3}}).gated[0].filtered[0], 3 - 2 * share, 1e-5f);
}

// One bin of a pixel, for what is read of it: half of the light, which is 2, in the specular component.
DeepImage oneBinImage() {
  DeepImage image{{0, 0, 1, 1}, {0, 0, 1, 1}, Buffer<uint64_t>(2, 0), {}, {}};
  image.offsets[1] = 1;
  for (const std::string c : {"R", "G", "B"}) {
    image.add(c, PixelType::Float).values.fill(2);
    image.add("diffuse." + c, PixelType::Float).values.fill(0.5f);
    image.add("specular." + c, PixelType::Float).values.fill(1.5f);
    image.add("variance." + c, PixelType::Float).values.fill(1.6f);
  }
  for (const char* name : {"A", "Z"}) image.add(name, PixelType::Float).values.fill(1);
  return image;
}

TEST(DenoiseData, AComponentHasThePartOfTheVarianceThatItHasOfTheLightSquared) {
  DeepImage image = oneBinImage();
  const DenoiseInputs inputs{.components = true, .variance = true};
  EXPECT_FLOAT_EQ(prepareColours(image, inputs).components[0].variance[0][0], 0.0625f * 1.6f);
  image.get("R")[0] = 1e-12f;  // of parts that take one another away
  EXPECT_FLOAT_EQ(prepareColours(image, inputs).components[0].variance[0][0], 1e12f * 1.6f);
}

TEST(DenoiseData, WhatIsNoSampleIsNone) {
  DeepImage image = oneBinImage();
  image.add("samples", PixelType::Float).values.fill(1e-6f);
  EXPECT_EQ(prepareColours(image, {.counts = true}).count[0], 0);
  // A colour that only its alpha makes too large.
  for (const char* name : {"R", "G", "B"}) image.get(name)[0] = 1e12f;
  EXPECT_EQ(prepareColours(image, {}).nonFinite, 0u);
  image.get("A")[0] = 1e-5f;
  EXPECT_EQ(prepareColours(image, {}).nonFinite, 1u);
}

TEST(DenoiseData, HalvesWithoutSamplesSayNothing) {
  DeepImage image = oneBinImage();
  for (const std::string half : {"half0.", "half1."}) {
    image.add(half + "samples", PixelType::Float).values.fill(0);
    for (const std::string c : {"R", "G", "B"}) image.add(half + c, PixelType::Float).values.fill(2);
  }
  const DenoiseData data = prepareColours(image, {.halves = true, .halfCounts = true});
  for (const float v : data.components[0].data) EXPECT_EQ(v, 0);
}

TEST(DenoiseData, AVolumesDepthIsItsMiddleWithTheVarianceOfAUniform) {
  DeepImage image = oneBinImage();
  image.add("ZBack", PixelType::Float).values.fill(3);
  image.add("variance.Z", PixelType::Float).values.fill(0.5f);
  const DenoiseInputs inputs{.depthVariance = true, .volumes = true};
  DenoiseData data = prepareColours(image, inputs);
  prepareFeatures(image, inputs, Buffer<uint8_t>(1, 0), data);
  EXPECT_FLOAT_EQ(data.depth.value[0][0], std::log(2.0f));
  EXPECT_FLOAT_EQ(data.depth.variance[0][0], (0.5f + 4.0f / 12) / 4);
  image.get("variance.Z")[0] = 1e14f;
  prepareFeatures(image, inputs, Buffer<uint8_t>(1, 0), data);
  EXPECT_EQ(data.depth.variance[0][0], 1e6f);
}

TEST(FeaturePrefilter, KeepsWhatIsEvenAndKnowsItsNoise) {
  Bins bins(14, 14, 1, 1);
  const auto even = [&](float value) {
    Feature feature;
    for (size_t c = 0; c < 3; ++c) {
      feature.value.emplace_back(bins.data.bins(), value);
      feature.variance.emplace_back(bins.data.bins(), 0.01f);
    }
    return feature;
  };
  bins.data.albedo = even(0.5f);
  bins.data.normal = even(0.9f);
  bins.data.depth.value.emplace_back(bins.data.bins(), 0.0f);
  bins.data.depth.variance.emplace_back(bins.data.bins(), 0.0f);
  prefilterFeatures(bins.data, {Buffer<uint8_t>(bins.data.bins(), 0), {}}, 4);
  const size_t middle = 7 * 14 + 7;
  EXPECT_NEAR(bins.data.albedo.value[0][middle], 0.5f, 1e-6f);
  EXPECT_NEAR(bins.data.normal.value[0][middle], 0.9f, 1e-6f);
  for (const Feature* feature : {&bins.data.albedo, &bins.data.normal})
    EXPECT_NEAR(feature->variance[0][middle], 0.01f / 25, 1e-6f) << "the mean of a window";
}

}  // namespace
}  // namespace fathom::deep
