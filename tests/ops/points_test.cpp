// Clouds of points: every sample at its place, seen from the camera in the pixel that it came from.
#include "deep/ops/points.h"

#include <gtest/gtest.h>

#include <ImathMatrix.h>

#include <array>
#include <cmath>
#include <cstring>

#include "base/error.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::makeDeep;
using reference::randomSamples;

struct Point {
  float x, y, z;
  std::array<uint8_t, 4> colour;
};

std::vector<Point> pointsOf(const DeepImage& image, const PointsParams& params) {
  const std::vector<uint8_t> bytes = plyPoints(image, params);
  std::vector<Point> points(bytes.size() / kPlyPointBytes);
  if (!points.empty()) std::memcpy(points.data(), bytes.data(), bytes.size());
  return points;
}

// A camera that stands at (5, -3, 2), turned about all axes; row vectors.
Imath::M44d worldToCamera() {
  return Imath::M44d().setTranslation(Imath::V3d(-5, 3, -2)) * Imath::M44d().setEulerAngles(Imath::V3d(0.3, -0.8, 0.1));
}

DeepImage withCamera(DeepImage image) {
  const Imath::M44d matrix = worldToCamera();
  std::array<float, 16> values;
  for (int i = 0; i < 16; ++i) values[size_t(i)] = float(matrix[i / 4][i % 4]);
  image.attributes.set("worldToCamera", values);
  image.attributes.set("fathom:ppuScale", 10.0f);
  return image;
}

TEST(Points, AreSeenInTheirPixelsAtTheirDepths) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const DeepImage image = withCamera(randomSamples({.seed = seed}));
    const Box& window = image.displayWindow;
    const std::vector<Point> world = pointsOf(image, {.leastAlpha = 0}),
                             camera = pointsOf(image, {.world = false, .leastAlpha = 0});
    ASSERT_EQ(world.size(), image.samples());
    ASSERT_EQ(camera.size(), image.samples());
    for (size_t p = 0; p < image.pixels(); ++p)
      for (size_t s = image.offsets[p]; s < image.offsets[p + 1]; ++s) {
        const Imath::V3d seen = Imath::V3d(world[s].x, world[s].y, world[s].z) * worldToCamera();
        const double x = (window.x0 + window.x1) / 2.0 + 10 * seen.x / seen.z;
        const double y = (window.y0 + window.y1) / 2.0 - 10 * seen.y / seen.z;
        ASSERT_NEAR(seen.z, image.get("Z")[s], 1e-4);
        ASSERT_NEAR(x, window.x0 + int(p % size_t(window.width())) + 0.5, 1e-3);
        ASSERT_NEAR(y, window.y0 + int(p / size_t(window.width())) + 0.5, 1e-3);
        ASSERT_NEAR(camera[s].x, seen.x, 1e-4);
        ASSERT_NEAR(camera[s].y, seen.y, 1e-4);
        ASSERT_EQ(camera[s].z, image.get("Z")[s]);
      }
  }
}

TEST(Points, HaveStraightColoursOfADisplay) {
  DeepImage image = makeDeep({{{2, 2, 0.5f, 0.25f, 1}, {3, 5, 1, 4, 2}, {6, 6, 0, 0.5f, 3}}}, 1);
  const PointsParams params{.world = false, .fieldOfView = 90.0f, .leastAlpha = 0};
  const std::vector<Point> points = pointsOf(image, params);
  ASSERT_EQ(points.size(), 3u);
  EXPECT_EQ(points[0].colour, (std::array<uint8_t, 4>{188, 255, 255, 128}));  // G is missing, B twice R
  EXPECT_EQ(points[1].z, 4);
  EXPECT_EQ(points[1].colour, (std::array<uint8_t, 4>{255, 255, 255, 255}));
  EXPECT_EQ(points[2].colour[0], 188);
}

TEST(Points, LeaveOutWhatIsThinOrNowhere) {
  const float nan = std::nanf(""), infinity = std::numeric_limits<float>::infinity();
  const DeepImage image =
      makeDeep({{{2, 2, 0.5f}, {3, 3, 0.1f}, {nan, 3, 1}, {infinity, 3, 1}, {4, 4, nan}, {5, 1, 2}}}, 1);
  const std::vector<Point> points = pointsOf(image, {.world = false, .fieldOfView = 50.0f, .leastAlpha = 0.2f});
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[1].z, 5);
}

TEST(Points, OfBandsAreThoseOfTheImage) {
  const DeepImage image =
      withCamera(randomSamples({.window = {0, 0, 40, 40}, .seed = 2, .volumes = true, .odd = true}));
  for (const int every : {1, 3}) {
    const PointsParams params{.every = every};
    std::vector<uint8_t> bands;
    for (int y = 0; y < 40; y += 7) {
      const std::vector<uint8_t> band = plyPoints(rows(image, y, std::min(40, y + 7)), params);
      bands.insert(bands.end(), band.begin(), band.end());
    }
    EXPECT_EQ(bands, plyPoints(image, params));
  }
}

TEST(Points, OneOfSeveral) {
  const DeepImage image = withCamera(randomSamples({.window = {0, 0, 100, 100}, .seed = 3}));
  const double all = double(pointsOf(image, {.leastAlpha = 0}).size());
  const double few = double(pointsOf(image, {.leastAlpha = 0, .every = 10}).size());
  EXPECT_NEAR(few / all, 0.1, 0.01);
}

TEST(Points, SayWhatIsMissing) {
  const DeepImage image = makeDeep({{{2, 2, 1}}}, 1);
  EXPECT_FALSE(hasWorldSpace(image));
  EXPECT_THROW(plyPoints(image, {.fieldOfView = 50.0f}), Error);
  EXPECT_THROW(plyPoints(image, {.world = false}), Error);
  EXPECT_THROW(plyPoints(image, {.world = false, .fieldOfView = 180.0f}), Error);
  EXPECT_THROW(plyPoints(image, {.world = false, .fieldOfView = 50.0f, .every = 0}), Error);
  EXPECT_TRUE(plyPoints(rows(image, -2, -2), {.world = false, .fieldOfView = 50.0f}).empty());
}

TEST(Points, TheHeaderIsAsLongForAnyNumber) {
  const std::string none = plyHeader(0);
  for (const uint64_t points : {uint64_t(1), uint64_t(1234567), UINT64_MAX}) {
    EXPECT_EQ(plyHeader(points).size(), none.size());
    EXPECT_NE(plyHeader(points).find(fmt::format("element vertex {}\ncomment -", points)), std::string::npos);
  }
}

}  // namespace
}  // namespace fathom::deep
