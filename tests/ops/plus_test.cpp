// Plus: light adds up, opacity does not.
#include "deep/ops/plus.h"

#include <gtest/gtest.h>

#include "deep/flatten.h"
#include "deep/ops/merge.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/radiative.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;

DeepImage randomImage(unsigned seed) {
  return randomSamples({.seed = seed, .volumes = seed % 2 == 0, .odd = seed % 3 == 0, .sorted = seed % 5 != 0});
}

TEST(Plus, EmissionIsTheLightOfTheImageWithoutItsOpacity) {
  for (unsigned seed = 1; seed <= 30; ++seed) {
    const DeepImage image = randomImage(seed);
    const flat::Image light = flatten(emission(image.copy())), flat = flatten(image);
    for (size_t p = 0; p < image.pixels(); ++p) {
      EXPECT_EQ(light.get("A").values[p], 0);
      for (const char* name : {"R", "G", "B"})
        ASSERT_NEAR(light.get(name).values[p], flat.get(name).values[p], 1e-5) << "pixel " << p << ", seed " << seed;
    }
  }
}

TEST(Plus, TheLightIsBehindWhatIsInFrontOfIt) {
  for (unsigned seed = 1; seed <= 30; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true});
    const DeepImage added = randomSamples({.seed = seed + 100, .volumes = true});
    const flat::Image sum = flatten(plus(image.copy(), added.copy())), flat = flatten(image);
    const DeepImage light = emission(added.copy());
    for (size_t p = 0; p < image.pixels(); ++p) {
      const auto media = reference::together(reference::mediaOf(image, p), reference::mediaOf(light, p));
      ASSERT_NEAR(sum.get("R").values[p], reference::integrate(media).totalLight(), 1e-5) << "seed " << seed;
      ASSERT_NEAR(sum.get("A").values[p], flat.get("A").values[p], 1e-6) << "seed " << seed;
    }
  }
}

TEST(Plus, WhatIsHiddenAddsNoSample) {
  const DeepImage image = reference::makeDeep({{{.alpha = 1, .colour = 1}, {.z = 2, .zBack = 2, .colour = 9}}}, 1);
  EXPECT_EQ(emission(image.copy()).samples(), 1u);
}

TEST(Plus, OfLightInFrontAddsIt) {
  const DeepImage image = reference::makeDeep({{{5, 5, 0.5f, 0.25f, 1}}}, 1);
  const DeepImage sparks = reference::makeDeep({{{1, 1, 0, 0.5f, 2}, {2, 2, 0.5f, 0.5f, 3}, {3, 3, 1, 1, 4}}}, 1);
  const DeepImage sum = plus(image.copy(), sparks.copy());
  EXPECT_EQ(sum.samples(), 4u);
  EXPECT_EQ(flatten(sum).get("R").values[0], 0.25f + 0.5f + 0.5f + 0.5f);
  EXPECT_EQ(flatten(sum).get("A").values[0], 0.5f);
  EXPECT_EQ(sum.find("id")->ids[0], 2u);
}

TEST(Plus, OfNothingIsTheImage) {
  const DeepImage image = randomImage(4), nothing = randomSamples({.window = {}, .volumes = true});
  EXPECT_EQ(reference::difference(plus(image.copy(), nothing.copy()), image), "");
  EXPECT_EQ(plus(nothing.copy(), image.copy()).dataWindow, image.dataWindow);
}

}  // namespace
}  // namespace fathom::deep
