// Cells of depth against clipping and flattening each of them, and their sum against the pixel.
#include "deep/depth_slice.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "deep/clip.h"
#include "deep/flatten.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::makeDeep;
using reference::randomSamples;

const std::vector<std::string> kColours{"R", "G", "B"};

TEST(DepthSlice, ACellIsWhatFlatteningMakesOfIt) {
  constexpr int kCells = 13;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const DeepImage image = randomSamples(
        {.seed = seed, .volumes = seed % 3 != 0, .most = 9, .odd = seed % 2 == 0, .sorted = seed % 4 != 0});
    const Box& window = image.dataWindow;
    const DepthAxis axis = seed % 2 ? DepthAxis{1.3, 6} : DepthAxis{0.9, 8, true};
    const std::vector<float> planes = cellPlanes(axis, kCells);
    const int y = window.y0 + int(seed % 7);
    const flat::Image slice = depthSlice(image, y, window.x0 - 1, window.x1 + 2, axis, kCells, kColours);
    for (int cell = 0; cell < kCells; ++cell) {
      const flat::Image flat = flatten(clip(image, planes[size_t(cell)], planes[size_t(cell) + 1]));
      for (const char* name : {"R", "G", "B", "A"})
        for (int x = window.x0 - 1; x < window.x1 + 2; ++x) {
          const float expected = window.contains(x, y) ? flat.get(name).values[window.index(x, y)] : 0;
          ASSERT_NEAR(slice.get(name).values[slice.dataWindow.index(x, cell)], expected, 2e-6f)
              << name << " seed " << seed << " x " << x << " cell " << cell;
        }
    }
  }
}

TEST(DepthSlice, CellsCompositedAreThePixel) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true, .most = 9, .sorted = seed % 2 == 0});
    const flat::Image flat = flatten(image);
    const Box& window = image.dataWindow;
    for (int y = window.y0; y < window.y1; ++y) {
      const DepthExtent extent = depthExtent(image, y);
      if (extent.nearest > extent.farthest) continue;
      const flat::Image slice = depthSlice(image, y, window.x0, window.x1,
                                           axisAround(extent.nearest, extent.farthest, seed % 3 == 0), 50, kColours);
      for (int x = window.x0; x < window.x1; ++x)
        for (const char* name : {"R", "A"}) {
          double passed = 1, sum = 0;
          for (int cell = 0; cell < 50; ++cell) {
            const size_t i = slice.dataWindow.index(x, cell);
            sum += passed * double(slice.get(name).values[i]);
            passed *= 1 - double(slice.get("A").values[i]);
          }
          ASSERT_NEAR(sum, flat.get(name).values[window.index(x, y)], 1e-5) << name << " seed " << seed << " x " << x;
        }
    }
  }
}

TEST(DepthSlice, APointOnAPlaneIsBehindIt) {
  const flat::Image slice = depthSlice(makeDeep({{{3, 3, 0.5f}}}, 1), -2, 3, 4, {1, 5}, 2, {"R"});
  EXPECT_EQ(slice.get("A").values[0], 0);
  EXPECT_EQ(slice.get("A").values[1], 0.5f);
}

// Two volumes whose alpha together rounds to 1 are thick, not opaque.
TEST(DepthSlice, WhatIsNearlyOpaqueIsCutAsAVolume) {
  constexpr float kAlpha = 0x1.fffffep-1f;
  const flat::Image slice =
      depthSlice(makeDeep({{{1, 5, kAlpha}, {1, 5, kAlpha}, {1, 5, kAlpha}}}, 1), -2, 3, 4, {1, 5}, 16, {"R"});
  EXPECT_NEAR(slice.get("A").values[0], -std::expm1(-3.0 * 24 * std::log(2.0) / 16), 1e-5);
}

TEST(DepthSlice, LeavesOutWhatIsNotOnTheAxis) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const DeepImage image = makeDeep({{{0.5f, 0.5f, 0.5f}, {3, 3, 0.25f}, {9, 9, 1}, {kInfinity, kInfinity, 1}}}, 1);
  const flat::Image slice = depthSlice(image, -2, 3, 4, {1, 9}, 2, {"R"});
  EXPECT_EQ(slice.get("A").values[0], 0.25f);
  EXPECT_EQ(slice.get("A").values[1], 1);  // `far` belongs to the last cell
  const flat::Image nearer = depthSlice(image, -2, 3, 4, {1, 8}, 2, {"R"});
  EXPECT_EQ(nearer.get("A").values[1], 0);
  EXPECT_EQ(depthExtent(image, -2).farthest, 9);
  EXPECT_GT(depthExtent(image, 5).nearest, depthExtent(image, 5).farthest);
  EXPECT_EQ(depthSlice(image, 7, 3, 4, {1, 9}, 2, {"R"}).get("A").values[0], 0);
  EXPECT_THROW(depthSlice(image, -2, 3, 4, {1, 9}, 2, {"diffuse.R"}), Error);
}

}  // namespace
}  // namespace fathom::deep
