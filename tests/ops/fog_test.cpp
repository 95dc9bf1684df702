// Fog: its amount is the integral of its density along each ray, and applied it looks as inserted.
#include "deep/ops/fog.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/tidy.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/radiative.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::integrate;
using reference::mediaOf;
using reference::randomSamples;

// A camera at (0, 3, 0) that looks along the world's -z, tilted down; 60 degrees wide.
void giveCamera(DeepImage& image, float tilt = 0.3f) {
  const float c = std::cos(tilt), s = std::sin(tilt);
  // Rows are what the world's axes become: x right, y up, z forward in the camera.
  const float y = 3;
  image.attributes.set("worldToCamera",
                       std::array<float, 16>{1, 0, 0, 0, 0, c, -s, 0, 0, -s, -c, 0, 0, -y * c, y * s, 1});
  image.attributes.set("fieldOfView", 60.0f);
}

DeepImage foggy(unsigned seed, bool odd = false) {
  DeepImage image = randomSamples({.seed = seed, .volumes = seed % 2 == 0, .odd = odd, .sorted = seed % 3 != 0});
  giveCamera(image);
  return image;
}

// The optical depth up to z by adding up many short steps.
double numericDepth(const DeepImage& image, const FogParams& params, int x, int y, double z) {
  const double focal = image.displayWindow.width() / (2 * std::tan(30 * M_PI / 180));
  const double right = (x + 0.5 - (image.displayWindow.x0 + image.displayWindow.x1) / 2.0) / focal;
  const double up = ((image.displayWindow.y0 + image.displayWindow.y1) / 2.0 - (y + 0.5)) / focal;
  const double length = std::sqrt(1 + right * right + up * up), slope = up * std::cos(0.3) - std::sin(0.3);
  const int steps = 20000;
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    const double at = params.near + (z - params.near) * (i + 0.5) / steps,
                 above = 3 + at * slope - params.height->height;
    sum +=
        (z - params.near) / steps * length * params.density * std::exp(-std::max(0.0, above) / params.height->falloff);
  }
  return sum;
}

TEST(Fog, EvenFogTakesLightByLength) {
  DeepImage image = randomSamples({.window = {0, 0, 9, 5}});
  FogParams params{.near = 2, .far = 7, .density = 0.1, .colour = {1, 0.5f, 0}};
  for (const bool camera : {false, true}) {
    if (camera) giveCamera(image);
    const DeepImage fog = fogVolumes(image, params);
    ASSERT_EQ(fog.samples(), image.pixels());
    const double focal = 9 / (2 * std::tan(30 * M_PI / 180)), corner = std::hypot(1, 4 / focal, 2 / focal);
    EXPECT_FLOAT_EQ(fog.get("A")[0], float(1 - std::exp(-0.5 * (camera ? corner : 1))));
    EXPECT_FLOAT_EQ(fog.get("A")[22], float(1 - std::exp(-0.5)));
    EXPECT_FLOAT_EQ(fog.get("G")[22], 0.5f * fog.get("A")[22]);
    EXPECT_EQ(fog.get("Z")[22], 2);
    EXPECT_EQ(fog.get("ZBack")[22], 7);
  }
  params.fieldOfView = 60.0f;
  image.attributes.erase("fieldOfView");
  EXPECT_GT(fogVolumes(image, params).get("A")[0], fogVolumes(image, params).get("A")[22]);
}

TEST(Fog, HeightFogIsTheIntegralOfItsDensity) {
  DeepImage image = randomSamples({.window = {0, 0, 9, 7}});
  image.displayWindow = {0, 0, 9, 7};
  giveCamera(image);
  for (const FogHeight& height : {FogHeight{.height = 0, .falloff = 0.5}, FogHeight{.height = 2, .falloff = 3},
                                  FogHeight{.height = 3.5, .falloff = 1}, FogHeight{.height = -50, .falloff = 0.01}}) {
    const FogParams params{.near = 1, .far = 12, .density = 0.2, .height = height};
    const DeepImage fog = fogVolumes(image, params);
    for (size_t p = 0; p < image.pixels(); ++p) {
      double depth = 0;
      const int x = int(p % 9), y = int(p / 9);
      for (size_t s = fog.offsets[p]; s < fog.offsets[p + 1]; ++s) {
        if (s + 1 < fog.offsets[p + 1]) {
          EXPECT_EQ(fog.get("ZBack")[s], fog.get("Z")[s + 1]);
        }
        depth += -std::log1p(-double(fog.get("A")[s]));
        ASSERT_NEAR(depth, numericDepth(image, params, x, y, fog.get("ZBack")[s]), 2e-5) << x << ", " << y;
      }
      ASSERT_NEAR(depth, numericDepth(image, params, x, y, 12), 2e-5) << x << ", " << y;
    }
  }
}

std::vector<FogParams> someFogs() {
  return {{.near = 1.5, .far = 4, .density = 0.4, .colour = {0.8f, 0.5f, 0.2f}},
          {.near = 0, .far = 100, .density = 0.05},
          {.near = 1, .far = 5, .density = 1.5, .height = FogHeight{.height = 1.5, .falloff = 0.7, .slabs = 5}},
          {.near = 1, .far = 5, .density = 0}};
}

// A volume whose alpha rounds to 1 would be opaque from its front on.
TEST(Fog, ThickFogIsNoWallWhereItBegins) {
  DeepImage image = randomSamples({.window = {0, 0, 9, 7}});
  image.displayWindow = {0, 0, 9, 7};
  giveCamera(image);
  for (const double density : {1.0, 40.0, 1000.0}) {
    const FogParams params{.near = 1, .far = 9, .density = density, .height = FogHeight{.height = 2.8, .falloff = 0.5}};
    const DeepImage fog = fogVolumes(image, params);
    for (size_t p = 0; p < fog.pixels(); ++p) {
      double depth = 0;
      for (size_t s = fog.offsets[p]; s < fog.offsets[p + 1]; ++s) {
        const double z = fog.get("Z")[s];
        const double before = z > 1 ? numericDepth(image, params, int(p % 9), int(p / 9), z) : 0;
        EXPECT_NEAR(std::exp(-before), std::exp(-depth), 1e-4);
        depth -= std::log1p(-double(fog.get("A")[s]));
        EXPECT_TRUE(fog.get("A")[s] < 0.9818f || depth > 23.9);  // the alpha of an optical depth of 4
      }
    }
  }
}

TEST(Fog, InsertedIsWhatTheEquationOfTransferShows) {
  for (unsigned seed = 1; seed <= 12; ++seed)
    for (const FogParams& params : someFogs()) {
      const DeepImage image = foggy(seed), fog = fogVolumes(image, params);
      const flat::Image flat = flatten(insertFog(image.copy(), params));
      for (size_t p = 0; p < image.pixels(); ++p) {
        const auto seen = integrate(reference::together(mediaOf(image, p), mediaOf(fog, p)));
        ASSERT_NEAR(flat.get("R").values[p], seen.totalLight(), 1e-5) << "pixel " << p << ", seed " << seed;
        ASSERT_NEAR(flat.get("A").values[p], seen.totalAlpha(), 1e-5) << "pixel " << p << ", seed " << seed;
      }
    }
}

TEST(Fog, AppliedLooksAsInserted) {
  for (unsigned seed = 1; seed <= 30; ++seed)
    for (const FogParams& params : someFogs()) {
      DeepImage image = foggy(seed, true);
      for (float& z : image.get("Z"))
        if (!std::isfinite(z)) z = 3.25f;  // at infinity they share their place
      const DeepImage applied = applyFog(image.copy(), params);
      const flat::Image one = flatten(applied), other = flatten(insertFog(image.copy(), params));
      EXPECT_LE(applied.samples(), tidy(image.copy()).image.samples() + image.pixels());
      for (const char* name : {"R", "G", "B", "A"})
        for (size_t p = 0; p < image.pixels(); ++p)
          ASSERT_NEAR(one.get(name).values[p], other.get(name).values[p], 1e-5)
              << name << " of pixel " << p << ", seed " << seed;
    }
}

TEST(Fog, AppliedKeepsWhatIsInFrontOfItAndIds) {
  const DeepImage image = reference::makeDeep({{{1, 1, 0.5f, 0.1f, 7}, {3, 3, 0.5f, 0.2f, 8}}, {{2, 2, 1, 0, 9}}}, 2);
  const DeepImage fogged = applyFog(image.copy(), {.near = 2, .far = 8, .density = 0.5, .colour = {1, 1, 1}});
  const auto samples = reference::samplesOf(fogged, 0);
  ASSERT_EQ(samples.size(), 3u);
  EXPECT_EQ(samples[0].colour, 0.1f);
  EXPECT_EQ(samples[1].id, 8u);
  EXPECT_EQ(samples[1].alpha, 0.5f);
  EXPECT_FLOAT_EQ(samples[1].colour, float(0.2 * std::exp(-0.5) + 0.5 * (1 - std::exp(-0.5))));
  EXPECT_EQ(samples[2].z, 8);
  EXPECT_EQ(samples[2].id, 0u);
  EXPECT_EQ(fogged.count(1), 1u);
}

TEST(Fog, IsTheSameForAnyBandOfRows) {
  DeepImage image = foggy(6, true);
  image.add("variance.R", PixelType::Float).values.fill(1);
  for (const FogParams& params : someFogs()) {
    const DeepImage applied = applyFog(image.copy(), params), inserted = insertFog(image.copy(), params);
    EXPECT_FALSE(applied.find("variance.R"));
    for (int y = image.dataWindow.y0; y < image.dataWindow.y1; ++y) {
      EXPECT_EQ(reference::difference(applyFog(rows(image, y, y + 1), params), rows(applied, y, y + 1)), "");
      EXPECT_EQ(reference::difference(insertFog(rows(image, y, y + 1), params), rows(inserted, y, y + 1)), "");
    }
  }
}

std::string errorOf(const DeepImage& image, const FogParams& params) {
  try {
    applyFog(image.copy(), params);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(Fog, SaysWhatIsMissing) {
  DeepImage image = randomSamples({});
  EXPECT_NE(errorOf(image, {.height = FogHeight{}}).find("worldToCamera"), std::string::npos);
  giveCamera(image);
  image.attributes.erase("fieldOfView");
  EXPECT_NE(errorOf(image, {.height = FogHeight{}}).find("fov"), std::string::npos);
  EXPECT_EQ(errorOf(image, {.height = FogHeight{}, .fieldOfView = 50.0f}), "");
  EXPECT_NE(errorOf(image, {.near = 3, .far = 3}), "");
  EXPECT_NE(errorOf(image, {.near = 3, .far = std::numeric_limits<double>::infinity()}), "");
  EXPECT_NE(errorOf(image, {.density = -1}), "");
  EXPECT_NE(errorOf(image, {.fieldOfView = 180.0f}), "");
  EXPECT_NE(errorOf(image, {.height = FogHeight{.falloff = 0}, .fieldOfView = 50.0f}), "");
  EXPECT_EQ(applyFog(randomSamples({.window = {}}), {}).samples(), 0u);
}

}  // namespace
}  // namespace fathom::deep
