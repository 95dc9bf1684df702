// Moving images in the plane and in depth, and inserting one in another. What becomes of pixels that are mixed is in
// resample_test.
#include "deep/ops/transform.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/progress.h"
#include "deep/flatten.h"
#include "deep/ops/crop.h"
#include "deep/ops/insert.h"
#include "deep/ops/merge.h"
#include "deep/pick.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST(Transform, WholeMovesPassSamplesBitForBit) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    DeepImage image = randomSamples({.seed = seed, .volumes = true, .odd = true, .sorted = false});
    image.add("samples", PixelType::Float).values.fill(4);
    DeepImage moved = transform(image.copy(), {.x = 3, .y = -7});
    EXPECT_EQ(moved.dataWindow, (Box{2, -5, 11, 2})) << "seed " << seed;
    moved.dataWindow = image.dataWindow;
    EXPECT_EQ(reference::difference(moved, image), "") << "seed " << seed;
  }
}

TEST(Transform, ThereAndBackIsTheImage) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true});
    DeepImage there = transform(image.copy(), {.x = 5, .y = 2, .z = 8, .zScale = 4});
    EXPECT_EQ(there.get("Z").size(), image.samples());
    const DeepImage back = transform(std::move(there), {.x = -5, .y = -2, .z = -2, .zScale = 0.25});
    for (size_t i = 0; i < image.samples(); ++i) {
      EXPECT_NEAR(back.get("Z")[i], image.get("Z")[i], 1e-5) << "seed " << seed;
      EXPECT_NEAR(back.get("ZBack")[i], image.get("ZBack")[i], 1e-5) << "seed " << seed;
    }
  }
}

TEST(Transform, RangesStayRangesAndPointsPoints) {
  DeepImage image = randomSamples({.window = {0, 0, 4, 1}, .seed = 4, .volumes = true});
  const size_t count = image.samples();
  ASSERT_GE(count, 5u);
  const std::span<float> z = image.get("Z"), zBack = image.get("ZBack");
  z[0] = 1, zBack[0] = std::nextafter(1.0f, 2.0f);
  z[1] = 1, zBack[1] = 1;
  z[2] = kNan, zBack[2] = 5;
  z[3] = 2, zBack[3] = kInfinity;
  z[4] = 3, zBack[4] = 2;
  const DeepImage moved = transform(std::move(image), {.z = 1000, .zScale = 0.5});
  EXPECT_EQ(moved.get("Z")[0], 1000.5f);
  EXPECT_EQ(moved.get("ZBack")[0], std::nextafter(1000.5f, kInfinity));
  EXPECT_EQ(moved.get("ZBack")[1], moved.get("Z")[1]);
  EXPECT_TRUE(std::isnan(moved.get("Z")[2]));
  EXPECT_EQ(moved.get("ZBack")[3], kInfinity);
  EXPECT_LT(moved.get("ZBack")[4], moved.get("Z")[4]);
}

TEST(Transform, ScalesTheVarianceOfDepths) {
  DeepImage image = randomSamples({.seed = 1});
  image.add("variance.Z", PixelType::Float).values.fill(0.5f);
  EXPECT_EQ(transform(std::move(image), {.zScale = 3}).get("variance.Z")[0], 4.5f);
}

TEST(Transform, ScalesAboutTheMiddleOfTheDisplayWindow) {
  DeepImage image = randomSamples({.window = {0, 0, 8, 6}, .seed = 1});
  image.displayWindow = {0, 0, 16, 8};
  const DeepImage twice = transform(image.copy(), {.x = 1, .scale = 2});
  EXPECT_EQ(twice.dataWindow, (Box{-7, -4, 9, 8}));
  EXPECT_EQ(twice.displayWindow, image.displayWindow);
  EXPECT_EQ(transformedWindow(image.dataWindow, image.displayWindow, {.x = 1, .scale = 2}), twice.dataWindow);
  EXPECT_EQ(twice.count(0), image.count(0));
}

TEST(Transform, PartPixelsFadeAtTheEdge) {
  DeepImage image = randomSamples({.window = {0, 0, 3, 2}, .seed = 1});
  const flat::Image before = flatten(image);
  const flat::Image after = flatten(transform(std::move(image), {.x = 0.25}));
  EXPECT_EQ(after.dataWindow, (Box{0, 0, 4, 2}));
  const auto& a = before.get("A").values;
  const auto& b = after.get("A").values;
  EXPECT_NEAR(b[0], 0.75f * a[0], 1e-6);
  EXPECT_NEAR(b[1], 0.75f * a[1] + 0.25f * a[0], 1e-6);
  EXPECT_NEAR(b[3], 0.25f * a[2], 1e-6);
}

TEST(Transform, TheSmallestPartOfAPixelCounts) {
  DeepImage image = randomSamples({.window = {0, 0, 3, 2}, .seed = 1});
  const flat::Image before = flatten(image);
  const flat::Image after = flatten(transform(std::move(image), {.x = 1e-4}));
  EXPECT_EQ(after.dataWindow, (Box{0, 0, 4, 2}));
  EXPECT_NEAR(after.get("A").values[3], 1e-4f * before.get("A").values[2], 1e-10);
}

TEST(Transform, RefusesWhatIsNoTransform) {
  const DeepImage image = randomSamples({.seed = 1});
  for (const Transform& how : {Transform{.x = kInfinity}, Transform{.z = kNan}, Transform{.scale = 0},
                               Transform{.zScale = -1}, Transform{.tolerance = -1}, Transform{.x = 3e9}})
    EXPECT_THROW(transform(image.copy(), how), Error);
}

TEST(Insert, IsTheMergeWithTheMovedImage) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage frame = randomSamples({.seed = seed});
    DeepImage smoke = randomSamples({.window = {4, 4, 20, 14}, .seed = 100 + seed, .volumes = true});
    smoke.displayWindow = {-5, -5, 30, 30};
    const Transform placement{.x = seed % 2 ? 2.5 : 2.0, .y = -3, .z = 1.5, .zScale = 0.5};
    std::vector<DeepImage> both;
    both.push_back(frame.copy());
    both.push_back(transform(smoke.copy(), placement));
    both[1].displayWindow = frame.displayWindow;
    const DeepImage inserted = insert(frame, smoke.copy(), placement);
    EXPECT_EQ(reference::difference(inserted, merge(both)), "") << "seed " << seed;
    EXPECT_EQ(inserted.displayWindow, frame.displayWindow);
    EXPECT_EQ(inserted.samples(), both[0].samples() + both[1].samples());
  }
}

// Of any pixels, with points and volumes, ids and statistics.
TEST(Insert, APartIsThatOfTheWhole) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const DeepImage frame = randomSamples({.seed = seed, .volumes = seed % 2 == 0});
    const DeepImage smoke = randomSamples({.window = {4, 4, 20, 14}, .seed = 100 + seed, .volumes = true});
    const Transform placement{.x = double(seed) - 4, .y = 2, .z = 1.5, .zScale = 0.5};
    const DeepImage whole = insert(frame, smoke.copy(), placement);
    for (const int step : {1, 2, 5}) {
      const Box box{whole.dataWindow.x0 - 3, whole.dataWindow.y0 + 1, whole.dataWindow.x1 + 2, whole.dataWindow.y1 + 4};
      std::vector<std::string> names;
      for (const Channel& channel : whole.channels) names.push_back(channel.name);
      DeepImage expected = pick(whole, box, step, names), part = insertPart(frame, smoke, placement, box, step, names);
      EXPECT_EQ(part.dataWindow, expected.dataWindow);
      EXPECT_EQ(reference::difference(part, expected), "") << "seed " << seed << ", step " << step;
    }
  }
  EXPECT_THROW(insertPart(randomSamples({.seed = 1}), randomSamples({.seed = 2}), {.x = 0.5}, {0, 0, 4, 4}, 1, {}),
               Error);
}

// Samples at one depth are composited otherwise where they are known to be statistics.
TEST(Insert, APartKnowsOfStatistics) {
  DeepImage frame = randomSamples({.seed = 1}), smoke = randomSamples({.seed = 2});
  for (DeepImage* image : {&frame, &smoke}) {
    image->add("samples", PixelType::Float).values.fill(4);
    std::ranges::fill(image->get("Z"), 1.0f);
  }
  const flat::Image whole = flatten(insert(frame, smoke.copy(), {}));
  const flat::Image part = flatten(insertPart(frame, smoke, {}, frame.dataWindow, 1, {"R", "A", "Z"}));
  for (size_t i = 0; i < whole.get("R").values.size(); ++i)
    ASSERT_EQ(part.get("R").values[i], whole.get("R").values[i]);
}

TEST(Insert, StopsWhenItIsTold) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(insert(randomSamples({.seed = 1}), randomSamples({.seed = 2}), {}, stop.get_token()), Cancelled);
}

TEST(Insert, FarBehindChangesNothingThatIsOpaque) {
  DeepImage frame = randomSamples({.seed = 2});
  std::fill(frame.get("A").begin(), frame.get("A").end(), 1.0f);
  const flat::Image before = flatten(frame);
  const DeepImage smoke = randomSamples({.seed = 3, .volumes = true});
  const flat::Image after = flatten(insert(frame, smoke.copy(), {.z = 1000}));
  for (size_t p = 0; p < frame.pixels(); ++p)
    if (frame.count(p) > 0) {
      EXPECT_EQ(after.get("R").values[p], before.get("R").values[p]);
    }
}

}  // namespace
}  // namespace fathom::deep
