// Where the layered network on deep frames ends: memory, parts of a frame, alphas of next to nothing and beyond 1.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "flat/finite.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/layered_results.h"
#include "tests/reference/noisy_frame.h"

namespace fathom::deep {
namespace {

using reference::denoiseLayered;
using reference::LayeredFrame;
using reference::makeNoisyFrame;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

bool isPremultiplied(const std::string& name) {
  return name.size() == 1 ? name != "Z"
                          : name.find("diffuse.") != std::string::npos || name.find("specular.") != std::string::npos ||
                                name.starts_with("albedo.") || name.starts_with("N.");
}

// Beside the band and a tile there is room for the rows that are read at once, an eighth of all; but no more than a MB is
// over.
TEST(LayersBounds, TheLeastMemoryHoldsABandATileAndWhatIsReadAtOnce) {
  const nn::LayersNet net = reference::randomNet();
  constexpr double kMb = 1 << 20;
  for (const auto& [width, height] : {std::pair{20000, 2000}, {2002, 17}, {40, 30}})
    for (const int lights : {1, 2}) {
      const int across = (width + 3) / 4 * 4, down = (height + 3) / 4 * 4,
                side = 64 + 2 * std::max(net.contextHalo(), net.filterHalo());
      const double held = std::min(4 + 2 * net.halo(), down) * net.bandBytes(2, lights);
      const double needed = across * (held + 4 * 6 * sizeof(float)) + net.tileBytes() * double(side) * side;
      const auto least = double(leastLayersBytes(net, 2, lights, {0, 0, width, height}));
      const double left = least - std::max(kMb, std::floor(least / 8));
      EXPECT_GE(left, needed - 1) << width << "x" << height;
      EXPECT_LE(left, needed + kMb) << width << "x" << height;
    }
}

// The largest tile of which four take no more than half of the memory, and rows halved until they fit beside one.
TEST(LayersBounds, BandsAreAsHighAsMemoryAllows) {
  const nn::LayersNet net = reference::randomNet();
  const auto up = [](int side) { return (side + 3) / 4 * 4; };
  const auto tileBytes = [&](int tile) {
    return net.tileBytes() * std::pow(tile + 2.0 * std::max(net.contextHalo(), net.filterHalo()), 2);
  };
  size_t cut = 0, whole = 0;
  for (const auto& [width, height] : {std::pair{2002, 1717}, {300, 200}})
    for (const int lights : {1, 2})
      for (const double factor : {1.0, 1.3, 2.0, 3.0, 5.0, 9.0, 20.0, 60.0}) {
        const Box window{-3, 7, width - 3, height + 7};
        const size_t memory = size_t(factor * double(leastLayersBytes(net, 2, lights, window)));
        const double free = double(memory) - std::clamp(double(memory) / 8, double(1 << 20), double(128 << 20));
        double tile = tileBytes(64);
        for (const int side : {128, 256, 384, 512})
          if (4 * tileBytes(side) <= free / 2) tile = tileBytes(side);
        const auto needed = [&](int rows) {
          return up(width) *
                 (std::min(rows + 2 * net.halo(), up(height)) * net.bandBytes(2, lights) + rows * 6.0 * sizeof(float));
        };
        int rows = up(height);
        while (rows > 4 && needed(rows) > free - tile) rows = up(rows / 2);
        LayerScale scale;
        scale.lights.resize(size_t(lights));
        const auto bands = layersBands(net, {.layers = 2, .memory = memory}, scale, window);
        ASSERT_EQ(bands.size(), size_t((height + rows - 1) / rows)) << width << " " << lights << " " << factor;
        EXPECT_EQ(bands.front(), std::pair(7, 7 + std::min(rows, height)));
        EXPECT_EQ(bands.back().second, height + 7);
        ++(rows < height ? cut : whole);
      }
  EXPECT_GT(cut, 8u);
  EXPECT_GT(whole, 4u);
}

// Rows are read together up to an eighth of the memory, from 1 to 128 MB.
TEST(LayersBounds, WhatIsReadAtOnceFollowsTheMemory) {
  const DeepImage image = makeNoisyFrame(16, 64, 1);
  LayerSource source = layerSource(image);
  source.bytes = [](int y0, int y1) { return size_t(y1 - y0) * 700'000; };
  std::vector<int> read;
  source.read = [&](int y0, int y1) {
    read.push_back(y1 - y0);
    return rows(image, y0, y1);
  };
  const auto most = [&](size_t memory) {
    read.clear();
    measureLayers(source, {.memory = memory});
    return *std::ranges::max_element(read);
  };
  EXPECT_EQ(most(1'000'000), 1);
  EXPECT_EQ(most(size_t(40) << 20), 7);  // of 5 MB
  EXPECT_EQ(most(0), 64);                // all 45 MB
  source.bytes = [](int y0, int y1) { return size_t(y1 - y0) * 10'000'000; };
  EXPECT_EQ(most(size_t(9) << 30), 13);  // of 128 MB
  EXPECT_EQ(most(0), 13);
}

TEST(LayersBounds, LightComesBackToWholeFramesOnly) {
  const DeepImage image = makeNoisyFrame(64, 48, 1);
  const nn::LayersNet net = reference::randomNet();
  const LayerSource source = layerSource(image);
  LayerScale scale = measureLayers(source, {});
  scale.lights = {nn::SampleLight::Diffuse};  // so that light is lacking
  const int y0 = image.dataWindow.y0, y1 = image.dataWindow.y1;
  const auto changed = [&](int from, int to) {
    bool result = false;
    denoiseLayers(net, {}, source, scale, from, to, [&](const LayeredRows& rows) { result |= !rows.factors.empty(); });
    return result;
  };
  EXPECT_TRUE(changed(y0, y1));
  EXPECT_FALSE(changed(y0, y1 - 4));
  EXPECT_FALSE(changed(y0 + 4, y1));
}

TEST(LayersBounds, ARenderOfLostSamplesIsUnknown) {
  DeepImage image = makeNoisyFrame(24, 16, 1);
  const size_t pixel = 7 * 24 + 5;
  ASSERT_GT(image.count(pixel), 0u);
  image.get("specular.G")[image.offsets[pixel]] = kNan;
  const nn::LayersNet net = reference::randomNet();
  const LayerSource source = layerSource(image);
  denoiseLayers(net, {}, source, measureLayers(source, {}), image.dataWindow.y0, image.dataWindow.y1,
                [&](const LayeredRows& rows) {
                  for (size_t i = 0; i < image.pixels(); ++i) EXPECT_EQ(std::isnan(rows.render[i]), i == pixel) << i;
                });
}

// Of one layer, all bins of a pixel have its colour.
TEST(LayersBounds, HardlyVisibleBinsKeepTheirColours) {
  DeepImage image = makeNoisyFrame(24, 20, 1);
  for (Channel& channel : image.channels)
    if (isPremultiplied(channel.name))
      for (float& v : channel.values) v *= 1e-5f;
  const LayeredFrame one = denoiseLayered(image, {.layers = 1});
  double brightest = 0;
  for (size_t i = 0; i < image.pixels(); ++i)
    for (uint64_t s = image.offsets[i]; s < image.offsets[i + 1]; ++s) {
      ASSERT_EQ(one.layers.count(i), 1u);
      const size_t layer = one.layers.offsets[i];
      const double colour = double(one.layers.get("R")[layer]) / double(one.layers.get("A")[layer]);
      ASSERT_NEAR(one.bins.get("R")[s] / image.get("A")[s], colour, 1e-4 * (1 + colour));
      brightest = std::max(brightest, colour);
    }
  EXPECT_GT(brightest, 0.1);
}

TEST(LayersBounds, AlphasBeyondOneAreOne) {
  // With a say and without.
  for (const bool lost : {false, true}) {
    DeepImage image = makeNoisyFrame(24, 20, 1);
    if (lost)
      for (size_t s = 0; s < image.samples(); s += 3) image.get("Z")[s] = kNan;
    DeepImage thick = image.copy();
    for (float& alpha : thick.get("A"))
      if (alpha == 1) alpha = 1.5f;
    const LayeredFrame expected = denoiseLayered(image), found = denoiseLayered(thick);
    for (const char* name : {"R", "G", "B"}) {
      EXPECT_TRUE(std::ranges::equal(found.flat.get(name).values, expected.flat.get(name).values)) << name;
      EXPECT_TRUE(std::ranges::equal(std::as_const(found.bins).get(name), std::as_const(expected.bins).get(name)))
          << name;
    }
  }
}

// Those of all layers together: what is seen of the pixel, by its alpha.
TEST(LayersBounds, SamplesWithoutASayGetTheColourOfTheirPixel) {
  DeepImage image = makeNoisyFrame(24, 20, 1);
  for (size_t s = 0; s < image.samples(); s += 3) image.get("Z")[s] = kNan;
  const LayeredFrame found = denoiseLayered(image);
  size_t lit = 0;
  for (size_t i = 0; i < image.pixels(); ++i)
    for (uint64_t s = image.offsets[i]; s < image.offsets[i + 1]; ++s) {
      const double alpha = double(found.flat.planes[3].values[i]), all = double(found.flat.planes[0].values[i]);
      if (s % 3 == 0) {
        ASSERT_NEAR(found.bins.get("R")[s], alpha > 0 ? double(image.get("A")[s]) * all / alpha : 0, 1e-5);
        lit += found.bins.get("R")[s] > 0.01f;
      }
    }
  EXPECT_GT(lit, 50u);
}

TEST(LayersBounds, AFrameWithoutASayIsBlack) {
  DeepImage image = makeNoisyFrame(12, 8, 1);
  for (float& z : image.get("Z")) z = kNan;
  const LayeredFrame found = denoiseLayered(image);
  for (const char* name : {"R", "G", "B"})
    for (const float v : found.bins.get(name)) ASSERT_EQ(v, 0);
}

TEST(LayersBounds, LightAloneIsWhereItWas) {
  DeepImage image = reference::makeDeep({{{7, 7, 0, 8}, {9, 9, 0, 2}}}, 1);
  image.add("G", PixelType::Float).values.fill(1);
  const LayeredFrame found = denoiseLayered(image);
  ASSERT_EQ(found.layers.samples(), 1u);
  EXPECT_EQ(found.layers.get("A")[0], 0);
  EXPECT_EQ(found.layers.get("Z")[0], 7);
  EXPECT_EQ(found.layers.get("R")[0], 10);
}

// Of a pixel as bright as can be and half transparent, all the light is twice as much.
TEST(LayersBounds, ColoursOfSamplesWithoutASayAreBounded) {
  DeepImage image = makeNoisyFrame(24, 16, 1);
  for (Channel& channel : image.channels)
    if (isPremultiplied(channel.name))
      for (float& v : channel.values) v *= 0.25f;
  const std::span<const float> alpha = std::as_const(image).get("A");
  for (const std::string c : {"R", "G", "B"})
    for (size_t s = 0; s < alpha.size(); ++s) {
      image.get(c)[s] = image.get("diffuse." + c)[s] = alpha[s] * 9e14f;
      image.get("specular." + c)[s] = 0;
      image.get("albedo." + c)[s] = s % 3 ? 0 : alpha[s];
    }
  for (size_t s = 1; s < image.samples(); s += 5) {
    image.get("Z")[s] = kNan;
    image.get("A")[s] = 1;
  }
  const LayeredFrame found = denoiseLayered(image);
  float most = 0;
  for (const char* c : {"R", "G", "B"})
    for (const float v : found.bins.get(c)) {
      ASSERT_TRUE(isFinite(v)) << v;
      most = std::max(most, v);
    }
  EXPECT_EQ(most, kLargest);
}

}  // namespace
}  // namespace fathom::deep
