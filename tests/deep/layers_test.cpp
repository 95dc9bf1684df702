// The layered network on deep frames, with random weights: what it reads, what it is made into, and what must not matter.
#include "deep/layers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "deep/flatten.h"
#include "flat/finite.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/layered_results.h"
#include "tests/reference/noisy_frame.h"

namespace fathom::deep {
namespace {

using reference::randomNet;
using Results = reference::LayeredFrame;

Results run(const DeepImage& image, LayersParams params = {}) {
  return reference::denoiseLayered(image, params);
}

// A frame in the bands that a memory limit asks for.
flat::Image banded(const DeepImage& image, const LayersParams& params, size_t& bands) {
  static const nn::LayersNet net = randomNet();
  flat::Image result{image.dataWindow, image.displayWindow, {}, {}};
  for (const char* name : {"R", "G", "B", "A"}) result.add(name);
  const LayerSource source = layerSource(image);
  bands = 0;
  denoiseLayers(net, params, source, measureLayers(source, params), image.dataWindow.y0, image.dataWindow.y1,
                [&](const LayeredRows& rows) {
                  const flat::Image part = flattenedLayers(rows);
                  for (size_t p = 0; p < 4; ++p)
                    std::ranges::copy(part.planes[p].values, result.planes[p].values.data() +
                                                                 image.dataWindow.index(image.dataWindow.x0, rows.y0));
                  ++bands;
                });
  return result;
}

void expectNear(const flat::Image& a, const flat::Image& b, float bound) {
  for (const char* name : {"R", "G", "B", "A"}) {
    const Buffer<float>&x = a.get(name).values, &y = b.get(name).values;
    ASSERT_EQ(x.size(), y.size());
    float most = 0;
    for (const float v : y) most = std::max(most, std::fabs(v));
    for (size_t i = 0; i < x.size(); ++i) ASSERT_NEAR(x[i], y[i], bound * most) << name << " " << i;
  }
}

TEST(Layers, FlattenToTheResult) {
  const DeepImage image = reference::makeNoisyFrame(37, 30, 1);
  for (const int layers : {1, 2, 4}) {
    const Results results = run(image, {.layers = layers});
    expectNear(flatten(results.layers), results.flat, 1e-6f);
    EXPECT_EQ(results.layers.dataWindow, image.dataWindow);
    const std::span<const float> z = std::as_const(results.layers).get("Z"), a = std::as_const(results.layers).get("A");
    size_t most = 0;
    for (size_t i = 0; i < results.layers.pixels(); ++i) {
      most = std::max(most, results.layers.count(i));
      for (uint64_t s = results.layers.offsets[i]; s < results.layers.offsets[i + 1]; ++s) {
        ASSERT_TRUE(a[s] >= 0 && a[s] <= 1);
        ASSERT_TRUE(z[s] > 1.9f && z[s] < 5.5f) << z[s];
        if (s > results.layers.offsets[i]) {
          ASSERT_LT(z[s - 1], z[s]);
        }
      }
    }
    EXPECT_EQ(most, size_t(layers));
    EXPECT_FALSE(results.layers.attributes.getInt("fathom:spp"));
    EXPECT_EQ(results.layers.attributes.getString("artist"), "nobody");
  }
}

TEST(Layers, ABrighterFrameIsDenoisedAlike) {
  const DeepImage image = reference::makeNoisyFrame(32, 24, 1);
  DeepImage bright = image.copy();
  for (Channel& channel : bright.channels) {
    const bool light = channel.name.size() == 1 ? channel.name != "A" && channel.name != "Z"
                                                : channel.name.find("diffuse.") != std::string::npos ||
                                                      channel.name.find("specular.") != std::string::npos;
    const bool variance =
        channel.name.starts_with("variance.") && channel.name.size() == 10 && channel.name != "variance.Z";
    for (float& v : channel.values) v *= light ? 4.0f : variance ? 16.0f : 1.0f;
  }
  const flat::Image expected = run(image).flat;
  flat::Image result = run(bright).flat;
  for (size_t c = 0; c < 3; ++c)
    for (float& v : result.planes[c].values) v /= 4;
  expectNear(result, expected, 1e-4f);
}

// What is denoised with a curve of light that is given.
Results runWith(const DeepImage& image, const flat::LightCurve& light) {
  static const nn::LayersNet net = randomNet();
  Results results;
  const LayerSource source = layerSource(image);
  LayerScale scale = measureLayers(source, {});
  scale.light = light;
  denoiseLayers(net, {}, source, scale, image.dataWindow.y0, image.dataWindow.y1, [&](const LayeredRows& rows) {
    results.flat = flattenedLayers(rows);
    results.layers = layersImage(rows, image.attributes);
    results.bins = inLayerColours(image.copy(), rows, source.inputs);
  });
  return results;
}

TEST(Layers, AllLightIsMultipliedByTheCurve) {
  const DeepImage image = reference::makeNoisyFrame(37, 30, 1);
  flat::LightCurve none(1), brighter(1);
  for (int i = 0; i < 5000; ++i) {
    const float d = 0.01f * std::exp2(0.0015f * float(i));
    none.add(d, d), brighter.add(d, 1.1f * d);
  }
  none.fit();
  brighter.fit();
  ASSERT_NEAR(brighter.factor(0.5f), 1.099f, 0.001f);
  const Results expected = runWith(image, none), found = runWith(image, brighter);
  for (size_t i = 0; i < image.pixels(); ++i) {
    float light = 0;
    for (const char* name : {"R", "G", "B"}) light += expected.flat.get(name).values[i] / 3;
    for (const char* name : {"R", "G", "B", "A"}) {
      const float f = name[0] == 'A' ? 1 : brighter.factor(light), was = expected.flat.get(name).values[i];
      ASSERT_NEAR(found.flat.get(name).values[i], f * was, 1e-5f * was) << name << " " << i;
      for (const auto& [a, b] : {std::pair{&expected.layers, &found.layers}, {&expected.bins, &found.bins}}) {
        ASSERT_EQ(a->offsets[i + 1], b->offsets[i + 1]);
        for (uint64_t s = a->offsets[i]; s < a->offsets[i + 1]; ++s) {
          const float sample = a->get(name)[s];
          ASSERT_NEAR(b->get(name)[s], f * sample, 1e-5f * sample) << name << " " << i;
        }
      }
    }
  }
}

// `lost`: a pixel of which a sample is not finite.
void expectBrightness(const DeepImage& image, size_t lost) {
  static const nn::LayersNet net = randomNet();
  const flat::Image noisy = flatten(image);
  const LayerSource source = layerSource(image);
  LayerScale scale = measureLayers(source, {});
  scale.light = flat::LightCurve(1);
  scale.light->fit();
  const Box& window = image.dataWindow;
  denoiseLayers(net, {}, source, scale, window.y0, window.y1, [&](const LayeredRows& rows) {
    const flat::Image result = flattenedLayers(rows);
    for (int y = window.y0; y < window.y1; ++y)
      for (int x = 0; x < window.width(); ++x) {
        const size_t i = size_t(y - window.y0) * size_t(window.width()) + size_t(x);
        const auto mean = [i](const flat::Image& of) {
          return (of.get("R").values[i] + of.get("G").values[i] + of.get("B").values[i]) / 3;
        };
        ASSERT_EQ(std::isnan(rows.render[i]), i == lost) << x << " " << y;
        if (i != lost) {
          ASSERT_NEAR(rows.render[i], mean(noisy), 1e-4f * (1 + mean(noisy))) << x << " " << y;
        }
        ASSERT_NEAR(rows.brightness(y, x), mean(result), 1e-5f * (1 + mean(result))) << x << " " << y;
      }
  });
}

TEST(Layers, RowsKnowTheBrightnessOfTheRenderAndOfTheResult) {
  const DeepImage image = reference::makeNoisyFrame(37, 30, 1);
  expectBrightness(image, image.pixels());
  // With samples that only shine, and one that is lost.
  DeepImage odd = image.copy();
  for (size_t s = 0; s < odd.samples(); s += 7) odd.get("A")[s] = 0;
  expectBrightness(odd, odd.pixels());
  size_t pixel = 0;
  while (odd.offsets[pixel + 1] <= 300) ++pixel;
  for (const char* name : {"R", "diffuse.R"}) odd.get(name)[300] = std::numeric_limits<float>::infinity();
  expectBrightness(odd, pixel);
}

// Light on black surfaces, divided by next to nothing, and white ones beside them.
TEST(Layers, WhatComesBackTimesAnAlbedoIsBounded) {
  DeepImage image = reference::makeNoisyFrame(24, 16, 1);
  const std::span<const float> alpha = image.get("A");
  for (const std::string c : {"R", "G", "B"})
    for (size_t s = 0; s < alpha.size(); ++s) {
      image.get(c)[s] = image.get("diffuse." + c)[s] = alpha[s] * 9e14f;
      image.get("specular." + c)[s] = 0;
      image.get("albedo." + c)[s] = s % 3 ? 0 : alpha[s];
    }
  const Results found = run(image);
  float most = 0;
  for (size_t c = 0; c < 3; ++c)
    for (const float v : found.flat.planes[c].values) {
      ASSERT_TRUE(isFinite(v)) << v;
      most = std::max(most, v);
    }
  EXPECT_EQ(most, kLargest);
  for (const DeepImage* result : {&found.layers, &found.bins})
    for (const char* c : {"R", "G", "B"})
      for (const float v : result->get(c)) ASSERT_TRUE(isFinite(v)) << v;
}

TEST(Layers, MemoryDoesNotChangeTheResult) {
  const DeepImage image = reference::makeNoisyFrame(44, 203, 1);
  const nn::LayersNet net = randomNet();
  const LayerScale scale = measureLayers(layerSource(image), {});
  ASSERT_EQ(scale.lights.size(), 2U);
  const size_t least = leastLayersBytes(net, 2, 2, image.dataWindow);
  EXPECT_LT(leastLayersBytes(net, 2, 1, image.dataWindow), least);
  size_t one = 0, few = 0, many = 0;
  const flat::Image expected = banded(image, {}, one);
  expectNear(banded(image, {.memory = least + least / 8}, few), expected, 1e-5f);
  expectNear(banded(image, {.memory = least}, many), expected, 1e-5f);
  EXPECT_EQ(one, 1U);
  EXPECT_GT(few, 1U);
  EXPECT_GT(many, few);
  EXPECT_EQ(layersBands(net, {.memory = least}, scale, image.dataWindow).size(), many);
  EXPECT_LE(least, mostLayersBytes(net, 2, 2, image.dataWindow));
  EXPECT_THROW(banded(image, {.memory = least / 2}, few), Error);
}

TEST(Layers, SamplesWithoutAlphaPassThroughWhatIsBeforeThem) {
  const auto withLight = [&](bool light) {
    DeepImage glow = reference::makeDeep(
        {{{1, 1, 0}, {2, 2, 0.25f}, {2.5f, 2.5f, 0}, {3, 3, 1}}, {{2, 2, 1}, {3, 3, 0}}, {{7, 7, 0}}, {{4, 4, 0.5f}}},
        4);
    for (const char* name : {"R", "G", "B"}) {
      Buffer<float>& values = glow.find(name) ? glow.find(name)->values : glow.add(name, PixelType::Float).values;
      const std::span<const float> alpha = glow.get("A");
      for (size_t i = 0; i < alpha.size(); ++i) values[i] = alpha[i] > 0 ? alpha[i] * 0.5f : light ? 8.0f : 0.0f;
    }
    return glow;
  };
  const Results dark = run(withLight(false)), lit = run(withLight(true));
  const float expected[] = {8 + 0.75f * 8, 0, 8, 0};
  for (size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(lit.flat.planes[0].values[i] - dark.flat.planes[0].values[i], expected[i], 1e-5) << i;
  EXPECT_EQ(lit.flat.planes[3].values[2], dark.flat.planes[3].values[2]);
  expectNear(flatten(lit.layers), lit.flat, 1e-5f);
  // In bins they keep their colours.
  EXPECT_EQ(lit.bins.get("R")[0], 8);
  EXPECT_EQ(lit.bins.get("R")[2], 8);
}

TEST(Layers, PoisonedSamplesHaveNoSay) {
  const DeepImage image = reference::makeNoisyFrame(24, 20, 1);
  const float bad[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e20f};
  std::optional<flat::Image> first;
  for (const float value : bad)
    for (const char* name : {"diffuse.G", "specular.R", "Z"}) {
      DeepImage poisoned = image.copy();
      poisoned.get(name)[300] = value;
      const Results results = run(poisoned);
      EXPECT_EQ(results.counts.nonFinite, 1U);
      for (const flat::Plane& plane : results.flat.planes)
        for (const float v : plane.values) ASSERT_TRUE(std::isfinite(v)) << plane.name;
      for (const float v : results.bins.get("R")) ASSERT_TRUE(std::isfinite(v));
      // All that is wrong with it does not matter.
      if (first) expectNear(results.flat, *first, 1e-6f);
      first = results.flat.copy();
    }
  DeepImage features = image.copy();
  for (const char* name : {"albedo.R", "N.X", "variance.R", "samples"}) features.get(name)[300] = bad[0];
  const Results results = run(features);
  EXPECT_EQ(results.counts.nonFinite, 0U);
  for (const flat::Plane& plane : results.flat.planes)
    for (const float v : plane.values) ASSERT_TRUE(std::isfinite(v)) << plane.name;
}

TEST(Layers, BinsGetTheColoursOfTheirLayers) {
  const DeepImage image = reference::makeNoisyFrame(24, 20, 1);
  const Results one = run(image, {.layers = 1});
  // Of one layer, all bins of a pixel have its colour.
  for (size_t i = 0; i < image.pixels(); ++i)
    for (uint64_t s = image.offsets[i]; s < image.offsets[i + 1]; ++s)
      ASSERT_NEAR(one.bins.get("R")[s] * one.flat.planes[3].values[i], image.get("A")[s] * one.flat.planes[0].values[i],
                  1e-5);
  const Results two = run(image, {.layers = 2});
  for (const char* kept : {"A", "Z", "albedo.R", "crypto"}) {
    const std::span<const float> a = std::as_const(two.bins).get(kept), b = image.get(kept);
    EXPECT_TRUE(std::ranges::equal(a, b)) << kept;
  }
  EXPECT_TRUE(two.bins.find("id"));
  for (const char* gone : {"diffuse.R", "specular.G", "variance.B", "half0.R", "samples"})
    EXPECT_FALSE(two.bins.find(gone)) << gone;
}

TEST(Layers, AnEmptyFrameIsEmpty) {
  const DeepImage image = reference::makeDeep({{}, {}, {}}, 3);
  DeepImage empty = image.copy();
  for (const char* name : {"R", "G", "B"})
    if (!empty.find(name)) empty.add(name, PixelType::Float);
  const Results results = run(empty);
  EXPECT_EQ(results.layers.samples(), 0U);
  for (const flat::Plane& plane : results.flat.planes)
    for (const float v : plane.values) EXPECT_EQ(v, 0);
}

}  // namespace
}  // namespace fathom::deep
