// Flattening, merging and clipping against the equation of transfer.
#include "tests/reference/radiative.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <random>

#include "deep/clip.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "deep/ops/merge.h"
#include "deep/tidy.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::integrate;
using reference::mediaOf;
using reference::Radiance;
using reference::randomSamples;
using reference::together;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

void expectSeen(const flat::Image& flat, size_t pixel, const Radiance& seen, unsigned seed) {
  const double scale = std::max(1.0, std::abs(seen.totalLight()));
  EXPECT_NEAR(flat.get("R").values[pixel], seen.totalLight(), 1e-5 * scale) << "pixel " << pixel << ", seed " << seed;
  EXPECT_NEAR(flat.get("A").values[pixel], seen.totalAlpha(), 1e-5) << "pixel " << pixel << ", seed " << seed;
  EXPECT_NEAR(1 - seen.totalAlpha(), seen.transmittance, 1e-9) << "pixel " << pixel << ", seed " << seed;
}

// Overlapping volumes, and alphas from 1e-30 over 1 - 2^-finest to 1.
DeepImage overlapping(unsigned seed, unsigned finest = 24) {
  DeepImage image = randomSamples({.seed = seed, .volumes = true, .most = 12, .sorted = seed % 2 == 0});
  std::mt19937 random(seed);
  for (float& alpha : image.get("A"))
    if (random() % 6 == 0) alpha = 1 - std::pow(2.0f, -float(random() % (finest + 1)));
  return image;
}

TEST(Radiative, OfOneVolumeIsItsColour) {
  for (const double alpha : {0.0, 1e-30, 1e-8, 0.3, 0.99, 1 - 0x1p-24, 1.0}) {
    const Radiance seen = integrate({{1, 3, alpha, 0.7}});
    EXPECT_NEAR(seen.totalLight(), 0.7, 1e-12) << alpha;
    EXPECT_NEAR(seen.totalAlpha(), alpha, 1e-12 * alpha) << alpha;
  }
}

TEST(Radiative, AgreesWithASumOverManyThinSlices) {
  const std::vector<reference::Medium> media = {{1, 4, 0.9, 0.6}, {2, 3, 0.8, 0.1}, {2.5, 2.5, 0.3, 0.2}};
  double light = 0, passed = 1;
  const double step = 1e-5;
  for (int i = 0; i < 300000; ++i) {
    const double z = 1 + (i + 0.5) * step, inner = z > 2 && z < 3 ? 1 : 0;
    if (i == 150000) light += passed * 0.2, passed *= 0.7;
    const double extinction = -std::log(1 - 0.9) / 3 - inner * std::log(1 - 0.8);
    light += passed * step * (0.6 / 0.9 * -std::log(1 - 0.9) / 3 + inner * 0.1 / 0.8 * -std::log(1 - 0.8));
    passed *= std::exp(-extinction * step);
  }
  const Radiance seen = integrate(media);
  EXPECT_NEAR(seen.totalLight(), light, 1e-5);
  EXPECT_NEAR(seen.transmittance, passed, 1e-9);
}

TEST(Radiative, FlattenAgrees) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const DeepImage image = overlapping(seed);
    const flat::Image flat = flatten(image);
    for (size_t p = 0; p < image.pixels(); ++p) expectSeen(flat, p, integrate(mediaOf(image, p)), seed);
  }
}

TEST(Radiative, TidyAndMergeAgree) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::vector<DeepImage> inputs;
    for (unsigned i = 0; i < 3; ++i) inputs.push_back(overlapping(100 * seed + i));
    const DeepImage merged = merge(inputs);
    const flat::Image flat = flatten(merged), tidied = flatten(tidy(merged.copy()).image);
    for (size_t p = 0; p < merged.pixels(); ++p) {
      std::vector<reference::Medium> media;
      for (const DeepImage& image : inputs) media = together(media, mediaOf(image, p));
      expectSeen(flat, p, integrate(media), seed);
      expectSeen(tidied, p, integrate(media), seed);
    }
  }
}

// The alpha of a cut volume is rounded to a float, which near 1 leaves few bits of its extinction: what is not tidy and
// then cut is known that well only where it lets enough light pass.
TEST(Radiative, ClipAgreesAtEveryDepth) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const bool tidied = seed % 2;
    const DeepImage image = tidied ? tidy(overlapping(seed)).image : overlapping(seed, 12);
    for (const float z : {0.9f, 1.37f, 2.0f, 2.71f, 4.5f}) {
      const flat::Image front = flatten(clip(image, -kInfinity, z));
      for (size_t p = 0; p < image.pixels(); ++p) expectSeen(front, p, integrate(mediaOf(image, p), 1, z), seed);
    }
  }
}

TEST(Radiative, CoincidentOpaqueThingsShowAnEqualPart) {
  const DeepImage image = reference::makeDeep(
      {{{2, 2, 1, 0.9f, 1}, {2, 2, 1, 0.3f, 2}, {2, 2, 0.5f, 9, 3}}, {{1, 3, 1, 0.9f, 1}, {1, 2, 1, 0.3f, 2}}}, 2);
  const flat::Image flat = flatten(image);
  for (size_t p = 0; p < 2; ++p) {
    expectSeen(flat, p, integrate(mediaOf(image, p)), 0);
    EXPECT_FLOAT_EQ(flat.get("R").values[p], 0.6f);
  }
}

TEST(Radiative, AgreesOnAFrameOfVolumes) {
  const std::string path = FATHOM_SHARED "/real/representativeDeepImage.exr";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path;
  const DeepImage image = read(path);
  const flat::Image flat = flatten(image);
  for (size_t p = 0; p < image.pixels(); p += 7) expectSeen(flat, p, integrate(mediaOf(image, p)), 0);
}

}  // namespace
}  // namespace fathom::deep
