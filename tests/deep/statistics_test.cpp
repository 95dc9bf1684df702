// Numbers about samples and depths.
#include "deep/statistics.h"

#include <gtest/gtest.h>

#include <limits>
#include <numeric>

namespace fathom::deep {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

DeepImage withCounts(const std::vector<uint64_t>& counts) {
  DeepImage image;
  image.dataWindow = image.displayWindow = {0, 0, int(counts.size()), 1};
  image.offsets = Buffer<uint64_t>(counts.size() + 1, 0);
  std::partial_sum(counts.begin(), counts.end(), image.offsets.begin() + 1);
  return image;
}

void fill(DeepImage& image, const char* name, const std::vector<float>& values) {
  std::copy(values.begin(), values.end(), image.add(name, PixelType::Float).values.begin());
}

TEST(Statistics, BucketsHoldWhatTheirNamesSay) {
  for (uint64_t count : {0, 1, 2, 3, 4, 5, 8, 9, 16, 17, 1000, 32768, 32769, 1000000}) {
    Statistics statistics;
    statistics.add(withCounts({count}));
    size_t bucket = 0;
    while (statistics.histogram[bucket] == 0) ++bucket;
    const std::string name = Statistics::bucketName(bucket);
    const uint64_t first = std::stoull(name);
    const size_t dash = name.find('-');
    const uint64_t last = name.back() == '+'          ? UINT64_MAX
                          : dash == std::string::npos ? first
                                                      : std::stoull(name.substr(dash + 1));
    EXPECT_TRUE(first <= count && count <= last) << count << " in " << name;
  }
}

TEST(Statistics, BandsAddUp) {
  Statistics statistics;
  statistics.add(withCounts({0, 3, 1}));
  statistics.add(withCounts({7, 0, 0}));
  EXPECT_EQ(statistics.pixels, 6u);
  EXPECT_EQ(statistics.samples, 11u);
  EXPECT_EQ(statistics.mostSamples, 7u);
  EXPECT_EQ(statistics.histogram[0], 3u);
}

TEST(Statistics, DepthsVolumesAndDamage) {
  DeepImage image = withCounts({3, 2, 2});
  fill(image, "Z", {1, 2, 3, 5, 4, kNan, 2});
  fill(image, "ZBack", {1, 2.5f, 2, 5, 9, 3, kInfinity});
  Statistics statistics;
  statistics.add(image);
  EXPECT_EQ(statistics.nearest, 1);
  EXPECT_EQ(statistics.farthest, 9);
  EXPECT_EQ(statistics.volumes, 2u);
  EXPECT_EQ(statistics.badDepths, 2u);
  EXPECT_EQ(statistics.unsortedPixels, 2u);
}

TEST(Statistics, EqualDepthsAreSortedAndTheFirstPixelOfTheMostIsTold) {
  DeepImage image = withCounts({2, 3, 3});
  fill(image, "Z", {1, 1, 2, 2, 3, 4, 4, 4});
  Statistics statistics;
  statistics.add(image);
  EXPECT_EQ(statistics.unsortedPixels, 0u);
  EXPECT_EQ(statistics.mostX, image.dataWindow.x0 + 1);
}

TEST(Statistics, WithoutDepthsThereIsNoRange) {
  Statistics statistics;
  statistics.add(withCounts({2, 1}));
  EXPECT_GT(statistics.nearest, statistics.farthest);
  EXPECT_EQ(statistics.unsortedPixels, 0u);
}

}  // namespace
}  // namespace fathom::deep
