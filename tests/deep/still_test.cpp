// What needs no denoising, against a slow search of the windows.
#include "deep/still.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "tests/reference/rendered_frame.h"

namespace fathom::deep {
namespace {

using reference::FrameParams;
using reference::renderFrame;

constexpr float kLevel = 0.3f;

struct Prepared {
  DeepImage image;
  DenoiseInputs inputs;
  DenoiseData data;
  Activity activity;
};

Prepared prepare(DeepImage image, int radius) {
  std::vector<std::string> names;
  for (const Channel& channel : image.channels) names.push_back(channel.name);
  Prepared p{std::move(image), findDenoiseInputs(names, {}), {}, {}};
  p.data = prepareColours(p.image, p.inputs);
  std::vector<ComponentGuide> guides;
  for (const DenoiseComponent& component : p.data.components) guides.push_back(colourGuide(p.data, component, 7));
  p.activity = findActivity(p.data, guides, p.image, p.inputs, radius, kLevel);
  return p;
}

TEST(Still, IsEveryPixelWithoutNoiseInItsWindow) {
  std::mt19937 random(3);
  for (const auto& [width, height] : {std::pair{40, 30}, {1, 30}, {30, 1}, {3, 3}, {17, 64}})
    for (const int radius : {1, 4, 6})
      for (const int noisyPixels : {0, 1, 2, 9}) {
        std::set<std::pair<int, int>> noisy;
        while (int(noisy.size()) < std::min(noisyPixels, width * height / 2))
          noisy.insert({int(random() % unsigned(width)), int(random() % unsigned(height))});
        const FrameParams params{.width = width, .height = height, .noise = [&](int x, int y) {
                                   return noisy.contains({x, y}) ? 0.7f : 0.0f;
                                 }};
        const Prepared p = prepare(renderFrame(params).noisy, radius);
        for (int y = 0; y < height; ++y)
          for (int x = 0; x < width; ++x) {
            const size_t pixel = size_t(y) * size_t(width) + size_t(x);
            bool expected = true;
            for (const auto& [nx, ny] : noisy) {
              const bool near = std::abs(nx - x) <= radius && std::abs(ny - y) <= radius;
              const bool seen = p.image.count(size_t(ny) * size_t(width) + size_t(nx)) > 0;
              expected = expected && !(near && seen);
            }
            if (p.image.count(pixel) == 0) expected = true;
            ASSERT_EQ(p.activity.still[pixel], expected ? 1 : 0)
                << x << ", " << y << " of " << width << "x" << height << " radius " << radius;
          }
      }
}

TEST(Still, NoiseOfAnyKindIsSeen) {
  const DeepImage quiet = renderFrame({.noise = [](int, int) { return 0.0f; }}).noisy;
  const size_t pixel = 20 * 48 + 20, bin = quiet.offsets[pixel];
  ASSERT_TRUE(prepare(quiet.copy(), 4).activity.still[pixel]);
  for (const char* channel : {"half0.diffuse.R", "half1.specular.B", "variance.G"}) {
    DeepImage image = quiet.copy();
    image.get(channel)[bin] += 0.2f;
    EXPECT_FALSE(prepare(std::move(image), 4).activity.still[pixel]) << channel;
  }
  // Only variances, and only an image.
  DeepImage image = quiet.copy();
  std::erase_if(image.channels, [](const Channel& c) { return c.name.starts_with("half"); });
  EXPECT_TRUE(prepare(image.copy(), 4).activity.still[pixel]);
  image.get("variance.G")[bin] += 0.2f;
  EXPECT_FALSE(prepare(image.copy(), 4).activity.still[pixel]);
}

TEST(Still, OneCameraSampleTellsNothing) {
  DeepImage image = renderFrame({.noise = [](int, int) { return 0.0f; }}).noisy;
  for (const char* channel : {"samples", "half0.samples"}) {
    const auto values = image.get(channel);
    std::fill(values.begin(), values.end(), 1.0f);
  }
  const auto none = image.get("half1.samples");
  std::fill(none.begin(), none.end(), 0.0f);
  DeepImage withoutHalves = image.copy();
  std::erase_if(withoutHalves.channels, [](const Channel& c) { return c.name.starts_with("half"); });
  for (DeepImage* each : {&image, &withoutHalves}) {
    const Prepared p = prepare(std::move(*each), 4);
    for (size_t pixel = 0; pixel < p.image.pixels(); ++pixel)
      EXPECT_EQ(p.activity.still[pixel], p.image.count(pixel) == 0);
  }
}

// As flat frames have it: nothing in a pixel that no camera sample counts for.
TEST(Still, NothingIsKnownToBeNothing) {
  DeepImage image = renderFrame({.noise = [](int, int) { return 0.0f; }}).noisy;
  const size_t pixel = 20 * 48 + 20;
  for (Channel& channel : image.channels)
    for (size_t p = 0; p < image.pixels() && channel.name != "A" && channel.type != PixelType::Uint; ++p)
      for (size_t b = image.offsets[p]; b < image.offsets[p + 1] && p % 48 < 40; ++b) channel.values[b] = 0;
  EXPECT_TRUE(prepare(image.copy(), 4).activity.still[pixel]);
  for (const char* channel : {"R", "diffuse.G"})
    for (const float odd : {0.1f, std::numeric_limits<float>::quiet_NaN()}) {
      DeepImage lit = image.copy();
      lit.get(channel)[image.offsets[pixel]] = odd;
      EXPECT_FALSE(prepare(std::move(lit), 4).activity.still[pixel]) << channel << " " << odd;
    }
  // What one camera sample saw is not known.
  image.get("samples")[image.offsets[pixel]] = 1;
  EXPECT_FALSE(prepare(std::move(image), 4).activity.still[pixel]);
}

// A pixel of two bins, each half of it and of the colour 1.
DeepImage twoBins() {
  DeepImage image{{0, 0, 1, 1}, {0, 0, 1, 1}, Buffer<uint64_t>(2, 0), {}, {}};
  image.offsets[1] = 2;
  for (const char* name : {"R", "G", "B", "A", "Z", "samples"}) image.add(name, PixelType::Float).values.fill(8);
  image.get("Z")[1] = 9;
  for (const char* name : {"R", "G", "B", "A"}) image.get(name)[0] = 0.5f, image.get(name)[1] = 1;
  return image;
}

// A thousandth of the colour: noise of a bin counts by the square of its part of the pixel.
TEST(Still, TheNoiseOfAPixelIsThatOfItsBins) {
  for (const auto& [variance, still] : {std::pair{1.6e-6f, 1}, {2.4e-6f, 0}}) {
    DeepImage image = twoBins();
    for (const char* name : {"variance.R", "variance.G", "variance.B"})
      image.add(name, PixelType::Float).values.fill(variance);
    EXPECT_EQ(prepare(std::move(image), 1).activity.still[0], still) << variance;
  }
  for (const auto& [apart, still] : {std::pair{2.5e-3f, 1}, {3.2e-3f, 0}}) {
    DeepImage image = twoBins();
    for (const char* name : {"half0.samples", "half1.samples"}) image.add(name, PixelType::Float).values.fill(4);
    for (const std::string name : {"R", "G", "B"})
      for (const float sign : {0.5f, -0.5f}) {
        const Buffer<float> values = image.find(name)->values.copy();
        Buffer<float>& half = image.add((sign > 0 ? "half0." : "half1.") + name, PixelType::Float).values;
        for (size_t b = 0; b < 2; ++b) half[b] = values[b] * (1 + sign * apart);
      }
    EXPECT_EQ(prepare(std::move(image), 1).activity.still[0], still) << apart;
  }
}

TEST(Still, WhatIsNotFiniteIsToBeFilledHoweverLittleOfThePixelItIs) {
  DeepImage image = renderFrame({.noise = [](int, int) { return 0.0f; }}).noisy;
  const auto alpha = image.get("A");
  size_t pixel = 0;
  while (image.count(pixel) < 2 || alpha[image.offsets[pixel]] > 0.3f) ++pixel;
  for (Channel& channel : image.channels)
    if (channel.name.starts_with("half")) channel.values[image.offsets[pixel]] = std::nanf("");
  EXPECT_FALSE(prepare(std::move(image), 1).activity.still[pixel]);
}

TEST(Still, TilesAskForComponentsThatHaveLight) {
  DeepImage image = renderFrame({.width = 80, .height = 40}).noisy;
  // Specular light only in the right quarter.
  for (Channel& channel : image.channels) {
    if (channel.name.find("specular") == std::string::npos) continue;
    for (size_t p = 0; p < image.pixels(); ++p)
      for (size_t b = image.offsets[p]; b < image.offsets[p + 1] && p % 80 < 60; ++b) channel.values[b] = 0;
  }
  const Prepared p = prepare(std::move(image), 4);
  EXPECT_EQ(activeComponents(p.data, p.activity, {0, 16, 32, 32}, 4), 1u);
  EXPECT_EQ(activeComponents(p.data, p.activity, {32, 16, 56, 32}, 4), 1u);
  EXPECT_EQ(activeComponents(p.data, p.activity, {32, 16, 57, 32}, 4), 3u);  // light within the window's reach
  EXPECT_EQ(activeComponents(p.data, p.activity, {64, 16, 80, 32}, 4), 3u);
  const Prepared quiet = prepare(renderFrame({.noise = [](int, int) { return 0.0f; }}).noisy, 4);
  EXPECT_EQ(activeComponents(quiet.data, quiet.activity, {0, 0, 32, 16}, 4), 0u);
}

}  // namespace
}  // namespace fathom::deep
