// What each role of channel makes of a plan.
#include "deep/ops/sample_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace fathom::deep {
namespace {

using ::testing::ElementsAre;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

template <class Values>
auto listOf(const Values& values) {
  return std::vector(values.begin(), values.end());
}

// A row of two pixels with three samples each; channels of every role.
DeepImage source() {
  const Box window{0, 0, 2, 1};
  DeepImage image{window, window, Buffer<uint64_t>(3, 0), {}, {}};
  image.offsets[1] = 3, image.offsets[2] = 6;
  const auto add = [&](const char* name, std::initializer_list<float> values) {
    std::ranges::copy(values, image.add(name, PixelType::Float).values.begin());
  };
  add("A", {0.1f, 0.2f, 0.3f, 0.4f, 0.5f, 0.6f});
  add("Z", {1, 2, 3, 4, 5, 6});
  add("ZBack", {1.5f, 2.5f, 3.5f, 4.5f, 5.5f, 6.5f});
  add("R", {10, kNan, 30, 40, 50, 60});
  add("half0.R", {1, 2, 3, 4, 5, 6});
  add("coc", {8, 16, 24, 32, 40, 48});
  add("samples", {1, 2, 3, 4, 5, 6});
  std::ranges::copy(std::vector<uint32_t>{11, 12, 13, 14, 15, 4294967295u},
                    image.add("id", PixelType::Uint).ids.begin());
  return image;
}

// Keeps two, changes one, mixes; the second pixel begins with a sample that follows the first one's in the source.
RowPlan plan() {
  RowPlan row;
  row.nextPixel();
  row.keep(1);
  row.keep(2);
  row.nextPixel();
  row.keep(3);
  row.change(4, 5.25f, 5.5f, 0.25f, 0.5f);
  row.mix(std::vector<RowPlan::Share>{{1, 1, 0.25f}, {5, 2, 0.75f}}, 7, 8, 0.75f);
  row.mix({}, 9, 9, 0.125f);
  return row;
}

DeepImage applied() {
  const RowPlan row = plan();
  const DeepImage image = source();
  return applyPlan(image, image.dataWindow, {&row, 1});
}

TEST(SamplePlan, CountsItsSamples) {
  EXPECT_EQ(plan().samples(), 6u);
  EXPECT_THAT(listOf(applied().offsets), ElementsAre(0, 2, 6));
}

TEST(SamplePlan, KeptSamplesThatFollowEachOtherAreOneRun) {
  const RowPlan row = plan();
  ASSERT_EQ(row.kept().size(), 1u);
  EXPECT_EQ(row.kept()[0].from, 1u);
  EXPECT_EQ(row.kept()[0].count, 3u);
  EXPECT_EQ(row.made().size(), 3u);
}

TEST(SamplePlan, DepthsAndAlphaComeFromThePlan) {
  const DeepImage image = applied();
  EXPECT_THAT(listOf(image.find("A")->values), ElementsAre(0.2f, 0.3f, 0.4f, 0.25f, 0.75f, 0.125f));
  EXPECT_THAT(listOf(image.find("Z")->values), ElementsAre(2, 3, 4, 5.25f, 7, 9));
  EXPECT_THAT(listOf(image.find("ZBack")->values), ElementsAre(2.5f, 3.5f, 4.5f, 5.5f, 8, 9));
}

TEST(SamplePlan, LightIsASumByWeight) {
  const DeepImage image = applied();
  const Buffer<float>& red = image.find("R")->values;
  EXPECT_TRUE(std::isnan(red[0]));  // kept as it is
  EXPECT_THAT(std::vector(red.begin() + 1, red.end()), ElementsAre(30, 40, 25, 120, 0));
  EXPECT_THAT(listOf(image.find("half0.R")->values), ElementsAre(2, 3, 4, 2.5f, 14, 0));
}

TEST(SamplePlan, CoordinatesAreMeansByPart) {
  EXPECT_THAT(listOf(applied().find("coc")->values), ElementsAre(16, 24, 32, 40, 40, 0));
}

TEST(SamplePlan, CountsAndIdsAreThoseOfTheLargestPart) {
  const DeepImage image = applied();
  EXPECT_THAT(listOf(image.find("samples")->values), ElementsAre(2, 3, 4, 5, 6, 0));
  EXPECT_THAT(listOf(image.find("id")->ids), ElementsAre(12, 13, 14, 15, 4294967295u, 0));
}

}  // namespace
}  // namespace fathom::deep
