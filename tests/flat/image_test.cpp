// Pieces of flat images, and the windows that they lie in.
#include "flat/image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace fathom::flat {
namespace {

TEST(Image, ACropIsThePixelsOfItsWindow) {
  Image image{{-3, 5, 4, 9}, {0, 0, 40, 120}, {}, {{"note", "kept"}}};
  Plane& red = image.add("R");
  for (int y = 5; y < 9; ++y)
    for (int x = -3; x < 4; ++x) red.values[image.dataWindow.index(x, y)] = float(100 * y + x);
  Buffer<float> depth = red.values.copy();
  for (float& v : depth) v += 0.5f;
  image.planes.push_back({"Z", std::move(depth)});
  for (const Box& box : {Box{-3, 5, 4, 9}, Box{-1, 6, 3, 8}, Box{3, 8, 4, 9}, Box{-3, 6, 4, 7}}) {
    const Image part = crop(image, box);
    EXPECT_EQ(part.dataWindow, box);
    EXPECT_EQ(part.displayWindow, image.displayWindow);
    EXPECT_EQ(part.attributes, image.attributes);
    ASSERT_EQ(part.planes.size(), 2u);
    for (int y = box.y0; y < box.y1; ++y)
      for (int x = box.x0; x < box.x1; ++x) {
        EXPECT_EQ(part.get("R").values[box.index(x, y)], float(100 * y + x));
        EXPECT_EQ(part.get("Z").values[box.index(x, y)], float(100 * y + x) + 0.5f);
      }
  }
}

TEST(Box, UnionsHoldBothAndEmptyOnesCountForNothing) {
  const Box a = {-2, 3, 4, 5}, b = {1, -7, 9, 4}, empty = {100, 100, 90, 101};
  EXPECT_EQ(unionOf(a, b), (Box{-2, -7, 9, 5}));
  EXPECT_EQ(unionOf(b, a), unionOf(a, b));
  EXPECT_EQ(unionOf(a, empty), a);
  EXPECT_EQ(unionOf(empty, b), b);
  EXPECT_EQ(intersect(a, b), (Box{1, 3, 4, 4}));
  EXPECT_TRUE(intersect(a, moved(a, 6, 0)).empty());
  EXPECT_FALSE(intersect(a, moved(a, 5, 1)).empty());
}

}  // namespace
}  // namespace fathom::flat
