// Laws of the scales: lightness follows the number, and no two identifiers near one another look alike.
#include "flat/colour_scale.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace fathom::flat {
namespace {

// CIE 1976, written down here again: the scales are drawn in another space.
double lightness(const std::array<float, 3>& srgb) {
  const auto linear = [](double v) { return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); };
  const double y = 0.2126 * linear(srgb[0]) + 0.7152 * linear(srgb[1]) + 0.0722 * linear(srgb[2]);
  return y > 216.0 / 24389 ? 116 * std::cbrt(y) - 16 : y * 24389 / 27;
}

TEST(ColourScale, LightnessRisesEvenly) {
  const double whole = lightness(evenColour(1)) - lightness(evenColour(0));
  EXPECT_GT(whole, 70);
  for (int i = 0; i < 20; ++i) {
    const double step = lightness(evenColour(float(i + 1) / 20)) - lightness(evenColour(float(i) / 20));
    EXPECT_NEAR(step, whole / 20, 0.45 * whole / 20) << i;
  }
}

TEST(ColourScale, BeyondTheEndsAreTheEnds) {
  EXPECT_EQ(evenColour(-1), evenColour(0));
  EXPECT_EQ(evenColour(7), evenColour(1));
  EXPECT_EQ(signedColour(-7), signedColour(-1));
}

TEST(ColourScale, SignsAreToldApartAndEquallyBright) {
  EXPECT_EQ(signedColour(0), (std::array<float, 3>{0, 0, 0}));
  for (const float t : {0.1f, 0.3f, 0.6f, 1.0f}) {
    const auto above = signedColour(t), below = signedColour(-t);
    EXPECT_GT(above[0], above[2]);
    EXPECT_LT(below[0], below[2]);
    EXPECT_NEAR(lightness(above), lightness(below), 4) << t;
    EXPECT_GT(lightness(above), lightness(signedColour(0.5f * t)));
  }
}

// Oklab to sRGB, from the definition's matrices in the other direction, inverted.
TEST(ColourScale, AreColoursOfOklab) {
  const std::array<std::array<double, 3>, 2> expected = {
      {{0.9464961, 0.7663411, 0.6236484}, {0.6697261, 0.8238274, 0.9861161}}};
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(signedColour(1)[c], expected[0][c], 1e-5);
    EXPECT_NEAR(signedColour(-1)[c], expected[1][c], 1e-5);
  }
}

TEST(ColourScale, IdentifiersDiffer) {
  EXPECT_EQ(identifierColour(0), (std::array<float, 3>{0, 0, 0}));
  std::set<std::array<int, 3>> seen;
  for (uint32_t id = 1; id <= 300; ++id) {
    const auto c = identifierColour(id);
    seen.insert({int(255 * c[0]), int(255 * c[1]), int(255 * c[2])});
    EXPECT_GT(lightness(c), 35) << id;
  }
  EXPECT_GT(seen.size(), 298u);
  EXPECT_NE(identifierColour(4294967295u), identifierColour(4294967294u));
}

}  // namespace
}  // namespace fathom::flat
