#include "deep/view_rays.h"

#include <gtest/gtest.h>

#include <cmath>

namespace fathom::deep {
namespace {

constexpr Box kWindow{0, 0, 200, 100};

TEST(ViewRays, WithoutAttributesAreParallel) {
  const ViewRays rays({}, kWindow, {}, Axis::Y);
  EXPECT_FALSE(rays.hasScale());
  EXPECT_FALSE(rays.hasPlace());
  EXPECT_EQ(rays.at(0, 0).length, 1);
}

TEST(ViewRays, LengthsFollowFromTheFieldOfView) {
  const ViewRays rays({}, kWindow, 90.0f, Axis::Y);
  EXPECT_NEAR(rays.at(199, 50).length, std::sqrt(1 + 0.995 * 0.995 + 0.005 * 0.005), 1e-6);
  EXPECT_NEAR(rays.at(0, 0).length, rays.at(199, 99).length, 1e-12);
}

TEST(ViewRays, StartAtTheCameraAndLookAlongIt) {
  Attributes attributes;  // at (1, 2, 3), not turned
  attributes.set("worldToCamera", std::array<float, 16>{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, -2, -3, 1});
  const ViewRay up = ViewRays(attributes, kWindow, 90.0f, Axis::Y).at(100, 0);
  EXPECT_NEAR(up.start, 2, 1e-9);
  EXPECT_NEAR(up.slope, 0.495, 1e-6);
  EXPECT_NEAR(ViewRays(attributes, kWindow, 90.0f, Axis::X).at(199, 0).slope, 0.995, 1e-6);
  EXPECT_NEAR(ViewRays(attributes, kWindow, 90.0f, Axis::Z).at(0, 0).slope, 1, 1e-9);
}

TEST(ViewRays, AMatrixWithoutInverseIsNoPlace) {
  Attributes attributes;
  attributes.set("worldToCamera", std::array<float, 16>{});
  EXPECT_FALSE(ViewRays(attributes, kWindow, 90.0f, Axis::Y).hasPlace());
}

TEST(ViewRays, CamerasThatLookBackwardsAreKnownByTheirProjection) {
  Attributes attributes;
  attributes.set("worldToCamera", std::array<float, 16>{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
  for (const float w : {1.0f, -1.0f}) {  // u = x / (2 |z|) + 1/2, v = -y / |z| + 1/2
    attributes.set("worldToNDC",
                   std::array<float, 16>{0.5f, 0, 0, 0, 0, -1, 0, 0, 0.5f * w, 0.5f * w, 0, w, 0, 0, 0, 0});
    const ViewRays rays(attributes, kWindow, {}, Axis::Z);
    ASSERT_TRUE(rays.hasScale());
    EXPECT_NEAR(rays.at(0, 0).slope, double(w), 1e-9);
    EXPECT_NEAR(ViewRays(attributes, kWindow, {}, Axis::X).at(199, 0).slope, 0.995, 1e-6);
  }
}

}  // namespace
}  // namespace fathom::deep
