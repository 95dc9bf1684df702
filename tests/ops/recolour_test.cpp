// Recolouring: what comes out flattens to the flat colour, and with `matte` to the flat alpha.
#include "deep/ops/recolour.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "deep/flatten.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;

// R G B A of random values; every fourth alpha is 0 or 1.
flat::Image randomFlat(const Box& window, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  flat::Image image{window, window, {}, {}};
  for (const char* name : {"R", "G", "B", "A"})
    for (float& value : image.add(name).values)
      value = *name == 'A' && random() % 4 == 0 ? float(random() % 2) : unit(random);
  return image;
}

float at(const flat::Image& image, const char* name, int x, int y) {
  return image.dataWindow.contains(x, y) ? image.get(name).values[image.dataWindow.index(x, y)] : 0;
}

TEST(Recolour, FlattensToTheFlatColourAndAlpha) {
  for (unsigned seed = 1; seed <= 60; ++seed) {
    const bool matte = seed % 2;
    const DeepImage deep =
        randomSamples({.seed = seed, .volumes = seed % 3 == 0, .odd = seed % 5 == 0, .sorted = seed % 4 != 0});
    const flat::Image flat = randomFlat({-3, 1, 6, 12}, seed);  // neither holds the other
    const flat::Image before = flatten(deep), after = flatten(recolour(deep.copy(), flat, {.matte = matte}));
    const Box& window = deep.dataWindow;
    for (int y = window.y0; y < window.y1; ++y)
      for (int x = window.x0; x < window.x1; ++x) {
        const bool empty = deep.count(window.index(x, y)) == 0;
        for (const char* name : {"R", "G", "B"})
          ASSERT_NEAR(at(after, name, x, y), empty ? 0 : at(flat, name, x, y), 2e-6)
              << name << " at " << x << ' ' << y << ", seed " << seed;
        const float alpha = matte && !empty ? at(flat, "A", x, y) : at(before, "A", x, y);
        ASSERT_NEAR(at(after, "A", x, y), alpha, 1e-6) << x << ' ' << y << ", seed " << seed;
      }
  }
}

TEST(Recolour, GivesEachSampleItsPartOfTheAlpha) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const DeepImage deep = randomSamples({.seed = seed});
    const DeepImage coloured = recolour(deep.copy(), randomFlat(deep.dataWindow, seed), {});
    for (size_t p = 0; p < deep.pixels(); ++p)
      for (size_t s = deep.offsets[p]; s + 1 < deep.offsets[p + 1]; ++s) {
        const double one = double(coloured.get("G")[s]) * double(deep.get("A")[s + 1]);
        const double other = double(coloured.get("G")[s + 1]) * double(deep.get("A")[s]);
        ASSERT_NEAR(one, other, 1e-6 * std::max(one, other)) << "seed " << seed;
      }
    for (const char* name : {"A", "Z"})
      for (size_t s = 0; s < deep.samples(); ++s) ASSERT_EQ(coloured.get(name)[s], deep.get(name)[s]);
    for (size_t s = 0; s < deep.samples(); ++s) ASSERT_EQ(coloured.find("id")->ids[s], deep.find("id")->ids[s]);
  }
}

TEST(Recolour, WithTheMatteOfTheImageItselfLeavesAlphas) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const DeepImage deep = randomSamples({.seed = seed});
    const DeepImage again = recolour(deep.copy(), flatten(deep), {.matte = true});
    for (size_t s = 0; s < deep.samples(); ++s)
      ASSERT_NEAR(again.get("A")[s], deep.get("A")[s], 1e-6) << "seed " << seed;
  }
}

// The alphas of a pixel once they flatten to `target`.
std::vector<float> matted(const std::vector<float>& alphas, float target) {
  reference::Pixels pixels(1);
  for (const float alpha : alphas)
    pixels[0].push_back({.z = 1 + float(pixels[0].size()), .zBack = 0, .alpha = alpha, .colour = alpha});
  const DeepImage deep = reference::makeDeep(pixels, 1);
  flat::Image flat{deep.dataWindow, deep.displayWindow, {}, {}};
  flat.add("R", 0.5f);
  flat.add("A", target);
  const DeepImage result = recolour(deep.copy(), flat, {.channels = {"R"}, .matte = true});
  for (size_t s = 0; s < result.samples(); ++s)  // B was twice the alpha and follows it
    EXPECT_NEAR(result.get("B")[s], alphas[s] > 0 ? 2 * result.get("A")[s] : 0, 1e-6);
  return {result.get("A").begin(), result.get("A").end()};
}

TEST(Recolour, LimitsOfAlpha) {
  EXPECT_EQ(matted({0.5f, 1}, 1), (std::vector<float>{0.5f, 1})) << "opaque stays as it is";
  const std::vector<float> opened = matted({0.5f, 1}, 0.75f);
  EXPECT_NEAR(1 - (1 - opened[0]) * (1 - opened[1]), 0.75f, 1e-6);
  EXPECT_GT(opened[1], 10 * opened[0]);
  const std::vector<float> closed = matted({0.5f, 0.9f}, 1);
  EXPECT_GT(closed[1], closed[0]);
  EXPECT_LT(closed[0], 1) << "the first sample does not hide the others";
  EXPECT_EQ(matted({0.5f, 0.9f}, 0), (std::vector<float>{0, 0}));
  EXPECT_EQ(matted({0, 0.5f}, 0.25f)[0], 0);
  const std::vector<float> clear = matted({0, 0}, 0.75f);
  EXPECT_NEAR(clear[0], 0.5f, 1e-6);
  EXPECT_EQ(clear[0], clear[1]);
}

TEST(Recolour, AddsChannelsAndDropsWhatIsVoid) {
  DeepImage deep = randomSamples({.seed = 4});
  for (const char* name : {"R", "G", "B"}) deep.erase(name);
  for (const char* name : {"variance.R", "variance.N.X", "samples"}) deep.add(name, PixelType::Float).values.fill(1);
  const flat::Image flat = randomFlat(deep.dataWindow, 4);
  const DeepImage plain = recolour(deep.copy(), flat, {}), matte = recolour(deep.copy(), flat, {.matte = true});
  EXPECT_TRUE(plain.find("R") && plain.find("G") && plain.find("B"));
  EXPECT_TRUE(!plain.find("variance.R") && plain.find("variance.N.X") && plain.find("samples"));
  EXPECT_TRUE(!matte.find("variance.R") && !matte.find("variance.N.X") && !matte.find("samples"));
}

TEST(Recolour, CountsWhatHasNoSample) {
  const DeepImage deep = reference::makeDeep({{}, {{.z = 1, .alpha = 1}}, {}, {}}, 2);
  flat::Image flat{{3, -2, 6, 0}, {}, {}, {}};
  for (const char* name : {"R", "G", "B", "A"}) flat.add(name);
  flat.find("A")->values[0] = 1;                                        // no sample
  flat.find("R")->values[1] = 1;                                        // a sample
  flat.find("R")->values[2] = 1;                                        // outside of the deep window: not looked at
  flat.find("G")->values[4] = std::numeric_limits<float>::quiet_NaN();  // counts as 0
  EXPECT_EQ(countUncovered(deep, flat, {}), (std::vector<size_t>{1, 0}));
}

TEST(Recolour, TakesEmptyImagesAndRefusesWhatItCannot) {
  const DeepImage deep = randomSamples({.seed = 1}), none = rows(deep, 4, 4);
  flat::Image flat = randomFlat({100, 100, 104, 104}, 1);
  EXPECT_EQ(recolour(none.copy(), flat, {}).samples(), 0u);
  const DeepImage black = recolour(deep.copy(), flat, {});
  for (const float value : black.get("R")) EXPECT_EQ(value, 0);
  EXPECT_THROW(recolour(deep.copy(), flat, {.channels = {"diffuse"}}), Error);
  EXPECT_THROW(recolour(deep.copy(), flat, {.channels = {"A"}}), Error);
  flat.add("id");
  EXPECT_THROW(recolour(deep.copy(), flat, {.channels = {"id"}}), Error);
  flat.planes.erase(flat.planes.begin() + 3);
  EXPECT_NO_THROW(recolour(deep.copy(), flat, {}));
  EXPECT_THROW(recolour(deep.copy(), flat, {.matte = true}), Error);
}

}  // namespace
}  // namespace fathom::deep
