// Planes on an axis, without a widget.
#include "gui/clip_model.h"

#include <gtest/gtest.h>

#include <limits>

namespace fathom::gui {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

ClipModel modelOf(const deep::DepthAxis& whole) {
  ClipModel model;
  model.setWhole(whole);
  return model;
}

TEST(ClipModel, OpenPlanesStandAtTheEnds) {
  const ClipModel model = modelOf({2, 6});
  EXPECT_EQ(model.nearPlace({}), 0);
  EXPECT_EQ(model.farPlace({}), 1);
  EXPECT_EQ(model.nearPlace({3, 5}), 0.25);
  EXPECT_EQ(model.farPlace({3, 5}), 0.75);
}

TEST(ClipModel, APlaneFollowsTheHandByPlaces) {
  const ClipModel linear = modelOf({2, 6}), log = modelOf({1, 100, true});
  EXPECT_FLOAT_EQ(linear.moved(ClipHandle::Near, {}, 0.25).near, 3);
  EXPECT_FLOAT_EQ(linear.moved(ClipHandle::Far, {3, 5}, -0.125).far, 4.5f);
  EXPECT_FLOAT_EQ(log.moved(ClipHandle::Near, {}, 0.5).near, 10);
  EXPECT_EQ(linear.moved(ClipHandle::None, {3, 5}, 0.1), (deep::DepthRange{3, 5}));
}

TEST(ClipModel, APlaneAtTheEndIsOpen) {
  const ClipModel model = modelOf({2, 6});
  EXPECT_EQ(model.moved(ClipHandle::Near, {3, 5}, -0.3).near, -kInfinity);
  EXPECT_EQ(model.moved(ClipHandle::Far, {3, 5}, 0.3).far, kInfinity);
}

TEST(ClipModel, PlanesDoNotPassEachOther) {
  const ClipModel model = modelOf({2, 6});
  const deep::DepthRange near = model.moved(ClipHandle::Near, {3, 5}, 0.9),
                         far = model.moved(ClipHandle::Far, {3, 5}, -0.9);
  EXPECT_LT(near.near, 5);
  EXPECT_GT(near.near, 4.9f);
  EXPECT_GT(far.far, 3);
  EXPECT_LT(far.far, 3.1f);
}

TEST(ClipModel, TheSlabKeepsItsLengthOnTheAxis) {
  const deep::DepthRange linear = modelOf({0, 10}).moved(ClipHandle::Slab, {3, 5, 0.1f, true}, 0.2);
  EXPECT_FLOAT_EQ(linear.near, 5);
  EXPECT_FLOAT_EQ(linear.far, 7);
  EXPECT_EQ(linear.soft, 0.1f);
  EXPECT_TRUE(linear.inverted);
  const deep::DepthRange log = modelOf({1, 100, true}).moved(ClipHandle::Slab, {2, 4}, 0.5);
  EXPECT_FLOAT_EQ(log.near, 20);
  EXPECT_FLOAT_EQ(log.far, 40);
  const deep::DepthRange half = modelOf({0, 10}).moved(ClipHandle::Slab, {3, kInfinity}, 0.1);
  EXPECT_FLOAT_EQ(half.near, 4);
  EXPECT_EQ(half.far, kInfinity);
  // It does not leave the axis.
  EXPECT_LT(modelOf({0, 10}).moved(ClipHandle::Slab, {3, 5}, 7).near, 10);
  EXPECT_GT(modelOf({0, 10}).moved(ClipHandle::Slab, {3, 5}, -7).far, 0);
}

TEST(ClipModel, HandlesCanBeToldApartWherePlanesMeet) {
  const ClipModel model = modelOf({0, 10});
  EXPECT_EQ(model.handleAt(0.29, 0.02, {3, 5}), ClipHandle::Near);
  EXPECT_EQ(model.handleAt(0.51, 0.02, {3, 5}), ClipHandle::Far);
  EXPECT_EQ(model.handleAt(0.4, 0.02, {3, 5}), ClipHandle::Slab);
  EXPECT_EQ(model.handleAt(0.7, 0.02, {3, 5}), ClipHandle::None);
  EXPECT_EQ(model.handleAt(0.499, 0.02, {5, 5}), ClipHandle::Near);
  EXPECT_EQ(model.handleAt(0.501, 0.02, {5, 5}), ClipHandle::Far);
  EXPECT_EQ(model.handleAt(0.5, 0.02, {}), ClipHandle::None);
}

TEST(ClipModel, ZoomKeepsTheDepthUnderTheCursor) {
  for (const bool logarithmic : {false, true}) {
    ClipModel model = modelOf({1, 100, logarithmic});
    const double depth = model.shown().depth(0.3);
    model.zoom(0.3, 0.25);
    EXPECT_TRUE(model.isZoomed());
    EXPECT_NEAR(model.shown().depth(0.3), depth, 1e-9);
    EXPECT_NEAR(model.whole().place(model.shown().far) - model.whole().place(model.shown().near), 0.25, 1e-9);
    model.zoom(0.9, 3);
    EXPECT_GE(model.shown().near, 1);
    EXPECT_LE(model.shown().far, 100);
    EXPECT_NEAR(model.whole().place(model.shown().far) - model.whole().place(model.shown().near), 0.75, 1e-9);
    model.zoom(0.3, 50);
    EXPECT_EQ(model.shown(), model.whole());
  }
}

TEST(ClipModel, PanStaysOnTheAxis) {
  ClipModel model = modelOf({0, 10});
  model.zoom(0.5, 0.2);  // 4 to 6
  model.pan(0.5);
  EXPECT_NEAR(model.shown().near, 5, 1e-9);
  EXPECT_NEAR(model.shown().far, 7, 1e-9);
  model.pan(100);
  EXPECT_NEAR(model.shown().near, 8, 1e-9);
  EXPECT_NEAR(model.shown().far, 10, 1e-9);
  model.pan(-100);
  EXPECT_NEAR(model.shown().near, 0, 1e-9);
}

TEST(ClipModel, APartStaysShownWhereThePictureChanges) {
  ClipModel model = modelOf({0, 10});
  model.setWhole({0, 20});
  EXPECT_EQ(model.shown(), (deep::DepthAxis{0, 20}));
  model.show({5, 6});
  const deep::DepthAxis part = model.shown();
  EXPECT_LT(part.near, 5);
  EXPECT_GT(part.far, 6);
  model.setWhole({0, 21});
  EXPECT_EQ(model.shown(), part);
  model.setWhole({0.1, 21, true});
  EXPECT_FALSE(model.isZoomed());
}

TEST(ClipModel, APartThatIsNotThereAnyMoreGivesWayToAll) {
  ClipModel model = modelOf({0, 10});
  model.show({5, 6});
  model.setWhole({100, 200});
  EXPECT_EQ(model.shown(), (deep::DepthAxis{100, 200}));
}

TEST(ClipSweep, GoesThroughAllDepthsAndBack) {
  const ClipSweep sweep({0, 10}, {});
  EXPECT_FLOAT_EQ(sweep.at(0).near, 0);
  EXPECT_FLOAT_EQ(sweep.at(2).near, 5);
  EXPECT_NEAR(sweep.at(4).near, 10, 1e-5);
  EXPECT_FLOAT_EQ(sweep.at(6).near, 5);
  EXPECT_EQ(sweep.at(2).far, kInfinity);
}

TEST(ClipSweep, BeginsWhereThePlanesAreAndKeepsTheSlab) {
  const ClipSweep slab({0, 10}, {3, 5}), far({0, 10}, {-kInfinity, 4});
  EXPECT_FLOAT_EQ(slab.at(0).near, 3);
  EXPECT_FLOAT_EQ(slab.at(0).far, 5);
  for (const double seconds : {0.3, 1.7, 2.9, 5.0, 7.7}) {
    const deep::DepthRange range = slab.at(seconds);
    EXPECT_NEAR(range.far - range.near, 2, 1e-5);
    EXPECT_GE(range.near, 0);
    EXPECT_LE(range.far, 10.0001f);
  }
  EXPECT_FLOAT_EQ(far.at(0).far, 4);
  EXPECT_GT(far.at(0.5).far, 4);
  EXPECT_EQ(far.at(0.5).near, -kInfinity);
}

// Depths that are not positive have no place on a logarithmic axis.
TEST(ClipSweep, ASlabThatBeginsBeforeALogarithmicAxisStaysFinite) {
  for (const float near : {-1.0f, 0.0f, 1e-30f}) {
    const ClipSweep sweep({1, 100, true}, {near, 10});
    for (const double seconds : {0.0, 1.0, 3.5, 6.0}) {
      const deep::DepthRange range = sweep.at(seconds);
      EXPECT_GE(range.near, 0.999f) << near << " at " << seconds;
      EXPECT_LE(range.far, 100.1f) << near << " at " << seconds;
      EXPECT_NEAR(range.far / range.near, 10, 1e-3);
    }
  }
}

}  // namespace
}  // namespace fathom::gui
