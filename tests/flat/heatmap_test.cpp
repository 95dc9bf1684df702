// Heatmaps and the small words on pictures.
#include "flat/heatmap.h"

#include <gtest/gtest.h>

#include <limits>

#include "flat/label.h"

namespace fathom::flat {
namespace {

std::array<float, 3> colourAt(const Image& image, int x, int y) {
  const size_t i = image.dataWindow.index(x, y);
  return {image.get("R").values[i], image.get("G").values[i], image.get("B").values[i]};
}

TEST(Heatmap, LargerIsBrighter) {
  double before = -1;
  for (int i = 0; i <= 100; ++i) {
    const auto [r, g, b] = heatColour(float(i) / 100);
    const double luma = 0.2126 * double(r) + 0.7152 * double(g) + 0.0722 * double(b);
    EXPECT_GT(luma, before) << i;
    before = luma;
  }
  EXPECT_EQ(heatColour(-5), heatColour(0));
  EXPECT_EQ(heatColour(7), heatColour(1));
}

TEST(Heatmap, PixelsFollowTheLogarithmOfTheError) {
  Plane errors{"error", Buffer<float>(6)};
  const float values[6] = {0, 0.01f, 0.1f, 1, 50, std::numeric_limits<float>::quiet_NaN()};
  std::copy(values, values + 6, errors.values.begin());
  const Image image = heatmap(errors, {7, 7, 10, 9});
  EXPECT_EQ(colourAt(image, 0, 0), heatColour(0));
  EXPECT_EQ(colourAt(image, 1, 0), heatColour(0));
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(colourAt(image, 2, 0)[c], heatColour(0.5f)[c], 1e-5f);
  EXPECT_EQ(colourAt(image, 0, 1), heatColour(1));
  EXPECT_EQ(colourAt(image, 1, 1), heatColour(1));
  EXPECT_EQ(colourAt(image, 2, 1), (std::array<float, 3>{0, 1, 1}));
}

TEST(Label, LettersStandSideBySideAndAreCutAtTheEdge) {
  const Box window = {0, 0, 10, 7};
  Image image{window, window, {}, {}};
  for (const char* name : {"R", "G", "B"}) image.add(name);
  drawLabel(image, 1, 1, "i1L", 1, {1, 0.5f, 0.25f});
  const char* expected[7] = {
      "..........",  //
      ".###..#..#",  //
      "..#..##..#",  //
      "..#...#..#",  //
      "..#...#..#",  //
      ".###.###.#",  //
      "..........",
  };
  for (int y = 0; y < 7; ++y)
    for (int x = 0; x < 10; ++x)
      EXPECT_EQ(colourAt(image, x, y)[1], expected[y][x] == '#' ? 0.5f : 0) << x << ", " << y;
  EXPECT_EQ(labelWidth("i1L", 1), 11);
  EXPECT_EQ(labelWidth("i1L", 3), 33);
  EXPECT_EQ(labelWidth("", 3), 0);
}

}  // namespace
}  // namespace fathom::flat
