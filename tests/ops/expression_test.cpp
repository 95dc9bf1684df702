// Expressions: formulas over channels, in order; what they may not do is told with the place.
#include "deep/ops/expression.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "deep/volume.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;

DeepImage set(const DeepImage& image, std::string text, bool unpremultiplied = false) {
  return expression(image.copy(), {.set = std::move(text), .unpremultiplied = unpremultiplied});
}

std::string errorOf(const DeepImage& image, const std::string& text) {
  try {
    set(image, text);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Expression, IsTheSameInCode) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    DeepImage image = randomSamples({.seed = seed, .volumes = true});
    image.add("diffuse.R", PixelType::Float).values.fill(0.25f);
    const DeepImage result = set(image,
                                 "R = R*0.5 + diffuse.R; A = clamp(A*3, 0, 1); G=R>0.5 ? G : smoothstep(2, 4, Z);"
                                 "B = max(x, y)*10 + i + n*0.1; deep.new = mod(-1, 3) + lerp(2, 4, 0.5) + floor(1.5);");
    size_t pixel = 0;
    for (int y = image.dataWindow.y0; y < image.dataWindow.y1; ++y)
      for (int x = image.dataWindow.x0; x < image.dataWindow.x1; ++x, ++pixel)
        for (size_t s = image.offsets[pixel]; s < image.offsets[pixel + 1]; ++s) {
          const double red = double(image.get("R")[s]) * 0.5 + 0.25, z = image.get("Z")[s];
          const double t = std::clamp((z - 2) / 2, 0.0, 1.0);
          const double i = double(s - image.offsets[pixel]), n = double(image.count(pixel));
          ASSERT_EQ(result.get("R")[s], float(red));
          ASSERT_EQ(result.get("A")[s], float(std::min(double(image.get("A")[s]) * 3, 1.0)));
          ASSERT_EQ(result.get("G")[s], red > 0.5 ? image.get("G")[s] : float(t * t * (3 - 2 * t)));
          ASSERT_EQ(result.get("B")[s], float(std::max(x, y) * 10 + i + n * 0.1));
          ASSERT_EQ(result.get("deep.new")[s], 6);
          ASSERT_EQ(result.find("id")->ids[s], image.find("id")->ids[s]);
        }
  }
}

TEST(Expression, ReadsAndSetsIdsExactly) {
  DeepImage image = reference::makeDeep({{{.id = 4294967295u}, {.id = 4294967294u}, {.id = 7}, {.id = 0}}}, 1);
  image.add("other", PixelType::Uint).ids.fill(0);
  const DeepImage copy = set(image, "other = id");
  const DeepImage odd = set(image, "other = i==0 ? -1 : i==1 ? 1e300 : i==2 ? 2.6 : 0/0; R = other");
  for (size_t s = 0; s < 4; ++s) EXPECT_EQ(copy.find("other")->ids[s], image.find("id")->ids[s]);
  const uint32_t expected[] = {0, 4294967295u, 3, 0};
  for (size_t s = 0; s < 4; ++s) EXPECT_EQ(odd.find("other")->ids[s], expected[s]);
  EXPECT_EQ(odd.get("R")[2], 3) << "a later formula sees what was set";
}

TEST(Expression, WhatIsNoNumberIsSetTo0) {
  const DeepImage image = reference::makeDeep({{{.z = 2, .zBack = 3, .alpha = 0.5f, .colour = 1}}}, 1);
  const DeepImage result = set(image, "R = 1/0; B = 1e16; A = sqrt(-1); Z = 1/0");
  EXPECT_EQ(result.get("R")[0], 0);
  EXPECT_EQ(result.get("B")[0], 0);
  EXPECT_EQ(result.get("A")[0], 0);
  EXPECT_TRUE(std::isinf(result.get("Z")[0]));
}

TEST(Expression, Unpremultiplied) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .odd = true});
    const DeepImage offset = set(image, "R = R + 0.5", true), alpha = set(image, "A = 0.5", true);
    for (size_t s = 0; s < image.samples(); ++s) {
      const double a = opacity(image.get("A")[s]), red = image.get("R")[s], green = image.get("G")[s];
      if (std::isnan(red) || std::isnan(green)) continue;
      ASSERT_NEAR(offset.get("R")[s], red + 0.5 * (a > 0 ? a : 1), 1e-6) << "seed " << seed;
      const double expected = a > 0 ? green / a * 0.5 : green;
      ASSERT_NEAR(alpha.get("G")[s], expected < 1e15 ? expected : 0, 1e-6 * expected) << "seed " << seed;
    }
  }
}

TEST(Expression, HalvesAreDividedByAlphaToo) {
  DeepImage image = reference::makeDeep({{{.alpha = 0.25f}}}, 1);
  image.add("half0.R", PixelType::Float).values.fill(0.5f);
  EXPECT_EQ(set(image, "half0.R = half0.R + 1", true).get("half0.R")[0], 0.75f);
}

TEST(Expression, DropsWhatTheNewValuesVoid) {
  DeepImage image = randomSamples({.seed = 2});
  image.attributes.set("fathom:spp", 16);
  for (const char* name : {"variance.R", "half0.R", "variance.G", "samples"})
    image.add(name, PixelType::Float).values.fill(4);
  const DeepImage red = set(image, "R = variance.R + 1");
  EXPECT_EQ(red.get("R")[0], 5);
  EXPECT_TRUE(!red.find("variance.R") && !red.find("half0.R") && red.find("variance.G") && red.find("samples"));
  const DeepImage alpha = set(image, "A = A*0.5; variance.R = 3");
  EXPECT_TRUE(alpha.find("variance.R") && !alpha.find("variance.G") && !alpha.find("samples"));
  EXPECT_FALSE(alpha.attributes.getInt("fathom:spp"));
  EXPECT_TRUE(red.attributes.getInt("fathom:spp"));
}

TEST(Expression, TellsWhatIsWrongAndWhere) {
  const DeepImage image = rows(randomSamples({.seed = 1}), 3, 3);
  EXPECT_EQ(errorOf(image, "G = G; R = R*(2"), "R = R*(2: Missing parenthesis, at character 16");
  EXPECT_EQ(errorOf(image, "R = G + depth*2"),
            "expected a channel or a function at character 9, found depth; there are x y i n R G B A Z id");
  EXPECT_EQ(errorOf(image, "R*2"), "expected CHANNEL = FORMULA at character 1, found R*2");
  EXPECT_EQ(errorOf(image, " ;"), "expected CHANNEL = FORMULA, found nothing");
  EXPECT_EQ(errorOf(image, "R = G = 2"), "expected one = in R = G = 2, found another at character 7");
  EXPECT_EQ(errorOf(image, "x = 2"), "expected a channel to set, found x");
  EXPECT_NE(errorOf(image, "R = 1, 2"), "");
  for (const char* text :
       {"R =", "R = *", "R = R*+", "R = \"a\"", "R = R R", "R = sin()", "R = a(3)", "R == 2", "2 = R", "R = @",
        "R = R ? 1", "a b = 2", "R = foo(", "R = ((((", "R = max()", "R = clamp(1, 2)", "R = 1 2"})
    EXPECT_NE(errorOf(image, text), "") << text;
  EXPECT_EQ(errorOf(image, "R = x<=y ? 1 : x>=y ? 2 : x!=y && y==x ? 3 : 4;"), "");
}

}  // namespace
}  // namespace fathom::deep
