// Crop and window: every pixel that stays has its samples bit for bit, every other one has none.
#include "deep/ops/crop.h"

#include <gtest/gtest.h>

#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::difference;
using reference::randomSamples;

DeepImage pixelOf(const DeepImage& image, int x, int y) {
  return toWindow(image, {x, y, x + 1, y + 1});
}

// Boxes inside, across each edge, around all of it, and beside it.
const std::vector<Box> kBoxes = {{1, 4, 5, 7},     {-9, 4, 2, 7}, {6, 4, 20, 7},  {1, -5, 5, 4},  {1, 7, 5, 30},
                                 {-9, -9, 30, 30}, {0, 3, 1, 4},  {40, 4, 50, 7}, {1, 40, 5, 50}, {3, 3, 3, 3}};

TEST(Crop, KeepsWhatIsInTheBoxOrOutsideOfIt) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true, .odd = true});
    const Box& window = image.dataWindow;
    for (const Box& box : kBoxes)
      for (const bool outside : {false, true}) {
        const DeepImage result = crop(image, box, outside);
        const Box common = intersect(window, box);
        EXPECT_EQ(result.dataWindow.area(), outside ? window.area() : common.area());
        if (!outside && !common.empty()) {
          EXPECT_EQ(result.dataWindow, common);
        }
        EXPECT_EQ(result.displayWindow, image.displayWindow);
        for (int y = window.y0; y < window.y1; ++y)
          for (int x = window.x0; x < window.x1; ++x) {
            const DeepImage found = pixelOf(result, x, y), before = pixelOf(image, x, y);
            const bool stays = common.contains(x, y) != outside;
            ASSERT_EQ(found.samples(), stays ? before.samples() : 0) << x << ", " << y << ", seed " << seed;
            ASSERT_TRUE(!stays || difference(found, before).empty()) << x << ", " << y << ", seed " << seed;
          }
      }
  }
}

TEST(Crop, OfAWindowAroundTheImageIsTheImageAndBack) {
  const DeepImage image = randomSamples({.seed = 7, .volumes = true});
  const DeepImage larger = toWindow(image, {-20, -3, 33, 40});
  EXPECT_EQ(larger.samples(), image.samples());
  EXPECT_EQ(difference(toWindow(larger, image.dataWindow), image), "");
}

// A single pixel against the samples where they lie: what the tests above compare with.
TEST(Crop, APixelHasItsSamples) {
  const DeepImage image = randomSamples({.seed = 8});
  for (size_t p = 0; p < image.pixels(); ++p) {
    const int width = image.dataWindow.width();
    const DeepImage pixel = pixelOf(image, image.dataWindow.x0 + int(p) % width, image.dataWindow.y0 + int(p) / width);
    ASSERT_EQ(pixel.samples(), image.count(p));
    for (size_t i = 0; i < pixel.samples(); ++i) {
      ASSERT_EQ(pixel.find("id")->ids[i], image.find("id")->ids[image.offsets[p] + i]);
      ASSERT_EQ(pixel.get("Z")[i], image.get("Z")[image.offsets[p] + i]);
    }
  }
}

}  // namespace
}  // namespace fathom::deep
