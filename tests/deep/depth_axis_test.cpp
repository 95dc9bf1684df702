// Depths on an axis and back, and the round ones among them.
#include "deep/depth_axis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fathom::deep {
namespace {

using ::testing::DoubleEq;
using ::testing::ElementsAre;
using ::testing::Pointwise;

TEST(DepthAxis, ThereAndBack) {
  for (const DepthAxis& axis : {DepthAxis{-3, 5}, DepthAxis{0.1, 1000, true}}) {
    EXPECT_NEAR(axis.place(axis.near), 0, 1e-12);
    EXPECT_NEAR(axis.place(axis.far), 1, 1e-12);
    for (const double place : {-0.5, 0.0, 0.3, 1.0, 1.5}) EXPECT_NEAR(axis.place(axis.depth(place)), place, 1e-12);
  }
  EXPECT_EQ((DepthAxis{0.1, 1000, true}).place(-1), -HUGE_VAL);
  EXPECT_NEAR((DepthAxis{0.1, 1000, true}).place(10), 0.5, 1e-12);
}

TEST(DepthAxis, CellsBeginAtNearAndHoldFar) {
  const std::vector<float> planes = cellPlanes({1, 3}, 4);
  EXPECT_THAT(std::vector<float>(planes.begin(), planes.end() - 1), ElementsAre(1, 1.5f, 2, 2.5f));
  EXPECT_GT(planes.back(), 3);
}

TEST(DepthAxis, HasRoomAround) {
  for (const bool logarithmic : {false, true})
    for (const auto& [nearest, farthest] : {std::pair{2.0, 9.0}, {5.0, 5.0}, {-4.0, 3.0}, {0.0, 0.0}, {1e-6, 1e9}}) {
      const DepthAxis axis = axisAround(nearest, farthest, logarithmic);
      EXPECT_LT(axis.near, nearest);
      EXPECT_GT(axis.far, farthest);
      EXPECT_EQ(axis.logarithmic, logarithmic && nearest > 0);
    }
  EXPECT_EQ(axisAround(1, -1, true), DepthAxis{});
}

// A twenty-fifth on both sides, of the axis or of its powers; next to nothing around a single depth.
TEST(DepthAxis, RoomIsInProportion) {
  const DepthAxis even = axisAround(2, 9, false), powers = axisAround(1, 1e4, true), one = axisAround(-5, -5, false);
  EXPECT_NEAR(even.near, 2 - 0.28, 1e-12);
  EXPECT_NEAR(even.far, 9 + 0.28, 1e-12);
  EXPECT_NEAR(std::log10(powers.near), -0.16, 1e-12);
  EXPECT_NEAR(std::log10(powers.far), 4.16, 1e-12);
  EXPECT_NEAR(one.far - one.near, 2 * 0.0005 * 5, 1e-12);
}

TEST(DepthAxis, ZoomsAroundAPlace) {
  for (const DepthAxis& whole : {DepthAxis{-3, 5}, DepthAxis{0.1, 1000, true}}) {
    const DepthAxis closer = zoomed(whole, whole, 0.25, 0.5);
    EXPECT_NEAR(closer.place(whole.depth(0.25)), 0.25, 1e-12);
    EXPECT_NEAR(closer.place(whole.depth(0.5)), 0.75, 1e-12);
    EXPECT_EQ(zoomed(closer, whole, 0.25, 100), whole);
    DepthAxis closest = whole;
    for (int i = 0; i < 1000; ++i) closest = zoomed(closest, whole, 0.7, 0.5);
    EXPECT_LT(float(closest.near), float(closest.far));
  }
}

TEST(DepthAxis, TicksAreRoundAndFew) {
  EXPECT_THAT(ticks({0, 1}, 6), Pointwise(DoubleEq(), {0.0, 0.2, 0.4, 0.6, 0.8, 1.0}));
  EXPECT_THAT(ticks({5.2, 19.3}, 4), Pointwise(DoubleEq(), {10.0, 15.0}));
  EXPECT_THAT(ticks({0.9, 60, true}, 9), Pointwise(DoubleEq(), {1.0, 2.0, 5.0, 10.0, 20.0, 50.0}));
  for (const double far : {1.001, 2.0, 7.3, 99.0, 12345.0, 1e12})
    for (const bool logarithmic : {false, true})
      for (const int most : {2, 3, 5, 8}) {
        const DepthAxis axis{1, far, logarithmic};
        const std::vector<double> found = ticks(axis, most);
        EXPECT_LE(int(found.size()), most) << far;
        EXPECT_GE(int(found.size()), 1) << far << " " << most;
        for (const double depth : found) EXPECT_TRUE(depth >= axis.near && depth <= axis.far) << depth;
      }
}

// 1.1 - 0.5 is a little more than 0.6, and 0.8 - 0.2 too.
TEST(DepthAxis, RoundingTakesNoTicksAway) {
  EXPECT_THAT(ticks({0.5, 1.1}, 3), Pointwise(DoubleEq(), {0.6, 0.8, 1.0}));
  EXPECT_THAT(ticks({0.2, 0.8}, 3), Pointwise(DoubleEq(), {0.5}));
}

TEST(DepthAxis, PowersBeginAndEndWithTheAxis) {
  EXPECT_THAT(ticks({1, 100, true}, 9), Pointwise(DoubleEq(), {1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0}));
  EXPECT_THAT(ticks({1.5, 60, true}, 9), Pointwise(DoubleEq(), {2.0, 5.0, 10.0, 20.0, 50.0}));
  EXPECT_THAT(ticks({0.02, 4000, true}, 3), Pointwise(DoubleEq(), {1.0, 100.0}));
}

}  // namespace
}  // namespace fathom::deep
