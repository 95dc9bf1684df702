// Resizing and reformatting: windows, odd sizes, and pictures that stay the same. The mixing itself is in resample_test.
#include "deep/ops/resize.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/ops/crop.h"
#include "deep/ops/reformat.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;

TEST(Resize, FitsTheDisplayWindowIntoTheSize) {
  DeepImage image = randomSamples({.window = {3, -2, 40, 21}, .seed = 1});
  image.displayWindow = {4, 2, 41, 25};  // 37 x 23
  for (const auto& [width, height] : {std::pair{19, 12}, {37, 7}, {1, 1}, {80, 50}, {74, 46}})
    for (const Filter filter : {Filter::Box, Filter::Bilinear}) {
      const DeepImage result = resize(image.copy(), width, height, filter);
      EXPECT_EQ(result.displayWindow.width(), width);
      EXPECT_EQ(result.displayWindow.height(), height);
      // The data window's edge lies outside of the display window's by the same part of it.
      const double top = -2 + (result.displayWindow.y0 + 2) - 4.0 * height / 23;
      EXPECT_EQ(result.dataWindow.y0, int(std::floor(top + 1e-9))) << height;
      const double left = 3 + (result.displayWindow.x0 - 3) - 1.0 * width / 37;
      EXPECT_EQ(result.dataWindow.x0, int(std::floor(left + 1e-9))) << width;
    }
}

TEST(Resize, TheCornerIsScaledToo) {
  EXPECT_EQ(resizedDisplay({10, -20, 30, 20}, 10, 80), (Box{5, -40, 15, 40}));
}

TEST(Resize, KeepsTheLightOfTheWholePicture) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomSamples({.window = {-1, 2, 30, 25}, .seed = seed, .volumes = true});
    const flat::Image flat = flatten(image);
    for (const auto& [width, height] : {std::pair{16, 12}, {10, 23}, {31, 8}, {50, 41}}) {
      const DeepImage result = resize(image.copy(), width, height);
      const flat::Image small = flatten(result);
      for (const char* name : {"R", "A"}) {
        double before = 0, after = 0;
        for (const float value : flat.get(name).values) before += double(value);
        for (const float value : small.get(name).values) after += double(value);
        const double area = double(width) * height / double(image.pixels());
        EXPECT_NEAR(after, before * area, 1e-5 * before * area) << name << ", seed " << seed << ", " << width;
      }
    }
  }
}

TEST(Resize, ToTheSameSizeIsTheImage) {
  DeepImage image = randomSamples({.seed = 3, .volumes = true, .odd = true, .sorted = false});
  image.add("half0.R", PixelType::Float).values.fill(1);
  for (const Filter filter : {Filter::Box, Filter::Bilinear})
    EXPECT_EQ(reference::difference(resize(image.copy(), 9, 7, filter), image), "");
}

TEST(Resize, ScalesThePixelsPerUnit) {
  DeepImage image = randomSamples({.window = {0, 0, 10, 4}, .seed = 3});
  image.attributes.set("fathom:ppuScale", 300.0f);
  image.attributes.set("fathom:spp", 16);
  const DeepImage result = resize(std::move(image), 5, 2);
  EXPECT_EQ(*result.attributes.getFloat("fathom:ppuScale"), 150.0f);
  EXPECT_FALSE(result.attributes.getInt("fathom:spp"));
}

TEST(Resize, RefusesWhatIsNoSize) {
  const DeepImage image = randomSamples({.seed = 1});
  EXPECT_THROW(resize(image.copy(), 0, 4), Error);
  EXPECT_THROW(resize(image.copy(), 4, -1), Error);
  EXPECT_THROW(resize(image.copy(), 4, 4, Filter::Box, -0.1), Error);
}

TEST(Reformat, MovesWholePixels) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true, .odd = true, .sorted = false});  // 9 x 7
    const Box display{10, 20, 22, 24};                                                                     // 12 x 4
    DeepImage stays = reformat(image.copy(), display, Placement::Stay, false);
    EXPECT_EQ(stays.dataWindow, image.dataWindow);
    EXPECT_EQ(stays.displayWindow, display);
    DeepImage corner = reformat(image.copy(), display, Placement::Corner, false);
    EXPECT_EQ(corner.dataWindow, (Box{10, 20, 19, 27}));
    DeepImage centre = reformat(image.copy(), display, Placement::Centre, false);
    EXPECT_EQ(centre.dataWindow, (Box{11, 18, 20, 25}));
    for (DeepImage* result : {&stays, &corner, &centre}) {
      result->dataWindow = image.dataWindow, result->displayWindow = image.displayWindow;
      EXPECT_EQ(reference::difference(*result, image), "") << "seed " << seed;
    }
  }
}

TEST(Reformat, CropsToTheDisplayWindow) {
  const DeepImage image = randomSamples({.seed = 1});
  const DeepImage result = reformat(image.copy(), {10, 20, 22, 24}, Placement::Centre, true);
  EXPECT_EQ(result.dataWindow, (Box{11, 20, 20, 24}));
  DeepImage middle = toWindow(image, {-1, 4, 8, 8});
  middle.dataWindow = result.dataWindow, middle.displayWindow = result.displayWindow;
  EXPECT_EQ(reference::difference(result, middle), "");
  EXPECT_TRUE(reformat(image.copy(), {100, 100, 110, 110}, Placement::Stay, true).dataWindow.empty());
}

}  // namespace
}  // namespace fathom::deep
