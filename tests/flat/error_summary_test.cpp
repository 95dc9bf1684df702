#include "flat/error_summary.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

namespace fathom::flat {
namespace {

TEST(ErrorSummary, IsTheMeanOfRelativeErrorsByFrameAndTile) {
  Image image{{10, 20, 110, 90}, {0, 0, 200, 100}, {}, {}};
  for (const char* c : kRgbNames) {
    image.add(c, 0.3f);
    image.add(std::string("error.") + c, 0.001f);
    image.add(std::string("variance.") + c, 0.01f);
  }
  for (int y = 84; y < 90; ++y)
    for (int x = 74; x < 110; ++x)
      for (const char* c : kRgbNames)
        image.find(std::string("error.") + c)->values[image.dataWindow.index(x, y)] = 0.1f;
  image.find("R")->values[0] = std::numeric_limits<float>::quiet_NaN();
  image.find("error.G")->values[1] = std::numeric_limits<float>::quiet_NaN();
  const ErrorSummary summary = summarizeErrors(image, noiseOf(image));
  ASSERT_EQ(summary.tiles.size(), 4u);
  EXPECT_EQ(summary.tiles[3].window.x0, 74);
  EXPECT_EQ(summary.tiles[3].window.y1, 90);
  EXPECT_NEAR(summary.tiles[0].relMse, 0.01, 1e-7);
  EXPECT_NEAR(summary.tiles[3].relMse, 1, 1e-6);
  const double share = 36.0 * 6 / 7000;
  EXPECT_NEAR(summary.relMse, (1 - share) * 0.01 + share, 1e-4);
  EXPECT_NEAR(summary.render, 0.1, 1e-4);
}

// What is no number is passed over, whole tiles of it too.
TEST(ErrorSummary, StepsOverWhatIsNotFinite) {
  Image image{{0, 0, 128, 4}, {0, 0, 128, 4}, {}, {}};
  for (const char* c : kRgbNames) {
    image.add(c, 0.3f);
    image.add(std::string("variance.") + c, 0.01f);
    Buffer<float>& error = image.add(std::string("error.") + c, 0.001f).values;
    for (size_t i = 0; i < error.size(); ++i)
      if (i % 128 >= 64 || i == 5) error[i] = i % 2 ? std::numeric_limits<float>::quiet_NaN() : 1e20f;
  }
  const ErrorSummary summary = summarizeErrors(image, noiseOf(image));
  ASSERT_EQ(summary.tiles.size(), 2u);
  EXPECT_NEAR(summary.tiles[0].relMse, 0.01, 1e-7);
  EXPECT_EQ(summary.tiles[1].relMse, 0);
  EXPECT_NEAR(summary.relMse, 0.01, 1e-7);
  EXPECT_NEAR(summary.render, 0.1, 1e-6);
}

}  // namespace
}  // namespace fathom::flat
