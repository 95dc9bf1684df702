// Keymix: the mean of two deep pixels looks as the mean of what they look like.
#include "deep/ops/keymix.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/ops/crop.h"
#include "deep/tidy.h"
#include "tests/reference/radiative.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::integrate;
using reference::mediaOf;
using reference::randomSamples;

flat::Image matteOf(const Box& window, unsigned seed) {
  std::mt19937 random(seed);
  flat::Image matte{window, window, {}, {}};
  matte.add("A");
  for (float& m : matte.planes[0].values) m = float(random() % 9) / 8;
  return matte;
}

DeepImage tidyImage(unsigned seed, bool odd = false) {
  return tidy(randomSamples({.seed = seed, .volumes = seed % 2 == 0, .odd = odd})).image;
}

TEST(Keymix, IsTheMeanOfBothAtEveryDepthWhereASampleEnds) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    DeepImage one = tidyImage(seed), zero = tidyImage(seed + 100);
    for (DeepImage* image : {&one, &zero})  // opaque volumes are seen whole where they begin, their mean is not
      for (float& alpha : image->get("A")) alpha = std::min(alpha, 0.999f);
    const flat::Image matte = matteOf(one.dataWindow, seed);
    const DeepImage mixed = keymix(one, zero, matte, "A");
    for (size_t p = 0; p < one.pixels(); ++p) {
      const double m = matte.planes[0].values[p];
      std::vector<double> depths = {1000};
      for (const auto& sample : mediaOf(mixed, p)) depths.push_back(std::nextafter(sample.zBack, 1000));
      for (const double z : depths) {
        const auto a = integrate(mediaOf(one, p), 1, z), b = integrate(mediaOf(zero, p), 1, z);
        const auto found = integrate(mediaOf(mixed, p), 1, z);
        ASSERT_NEAR(found.totalLight(), m * a.totalLight() + (1 - m) * b.totalLight(), 1e-5) << "seed " << seed;
        ASSERT_NEAR(found.totalAlpha(), m * a.totalAlpha() + (1 - m) * b.totalAlpha(), 1e-5) << "seed " << seed;
      }
    }
  }
}

TEST(Keymix, FlattenedIsTheMeanForOddSamplesToo) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const DeepImage one = randomSamples({.seed = seed, .volumes = true, .odd = true, .sorted = false});
    const DeepImage zero = randomSamples({.seed = seed + 100, .odd = true});
    const flat::Image matte = matteOf(one.dataWindow, seed);
    const flat::Image mixed = flatten(keymix(one, zero, matte, "A")), a = flatten(one), b = flatten(zero);
    for (const char* name : {"R", "G", "B", "A"})
      for (size_t p = 0; p < one.pixels(); ++p) {
        const float m = matte.planes[0].values[p];
        ASSERT_NEAR(mixed.get(name).values[p], m * a.get(name).values[p] + (1 - m) * b.get(name).values[p], 1e-5)
            << name << ", seed " << seed;
      }
  }
}

TEST(Keymix, PassesBitForBitWhereTheMatteIsOneOrZero) {
  const DeepImage one = tidyImage(4, true), zero = tidyImage(6, true);
  flat::Image matte{one.dataWindow, one.dataWindow, {}, {}};
  flat::Plane& plane = matte.add("key", 1);
  EXPECT_EQ(reference::difference(keymix(one, zero, matte, "key"), one), "");
  plane.values.fill(7);
  EXPECT_EQ(reference::difference(keymix(one, zero, matte, "key"), one), "");
  plane.values.fill(std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(reference::difference(keymix(one, zero, matte, "key"), zero), "");
  EXPECT_EQ(reference::difference(keymix(one, zero, matteOf({500, 0, 501, 1}, 1), "A"), zero), "");
  EXPECT_THROW(keymix(one, zero, matte, "A"), Error);
}

TEST(Keymix, DropsWhatDescribedTheSamples) {
  DeepImage one = tidyImage(1), zero = tidyImage(3);
  for (DeepImage* image : {&one, &zero}) image->add("variance.R", PixelType::Float).values.fill(1);
  EXPECT_FALSE(keymix(one, zero, matteOf(one.dataWindow, 1), "A").find("variance.R"));
}

TEST(Keymix, OfWindowsThatAreNotTheSame) {
  const DeepImage one = randomSamples({.window = {0, 0, 4, 3}, .seed = 1});
  DeepImage zero = randomSamples({.window = {10, 7, 15, 9}, .seed = 2});
  zero.erase("G");
  flat::Image matte = matteOf({0, 0, 15, 9}, 1);
  matte.planes[0].values.fill(0.25f);
  const DeepImage mixed = keymix(one, zero, matte, "A");
  EXPECT_EQ(mixed.dataWindow, (Box{0, 0, 15, 9}));
  const flat::Image flat = flatten(mixed), expected = flatten(one);
  for (size_t p = 0; p < one.pixels(); ++p) {
    const size_t at = mixed.dataWindow.index(int(p % 4), int(p / 4));
    EXPECT_NEAR(flat.get("G").values[at], 0.25f * expected.get("G").values[p], 1e-6);
  }
  for (size_t s = 0; s < mixed.samples(); ++s) EXPECT_NE(mixed.find("id")->ids[s], 0u);
  EXPECT_EQ(keymix(randomSamples({.window = {}}), randomSamples({.window = {}}), matte, "A").samples(), 0u);
}

TEST(Keymix, IsTheSameForAnyBandOfRows) {
  DeepImage one = randomSamples({.seed = 3, .volumes = true, .odd = true, .sorted = false});
  const DeepImage zero = randomSamples({.seed = 4, .odd = true});
  one.add("samples", PixelType::Float).values.fill(1);
  const flat::Image matte = matteOf(one.dataWindow, 5);
  const DeepImage whole = keymix(one, zero, matte, "A");
  for (int y = one.dataWindow.y0; y < one.dataWindow.y1; ++y)
    EXPECT_EQ(
        reference::difference(keymix(rows(one, y, y + 1), rows(zero, y, y + 1), matte, "A"), rows(whole, y, y + 1)),
        "");
}

}  // namespace
}  // namespace fathom::deep
