// Numbers about an image: counted here again, one sample after the other.
#include "deep/ops/stats.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::makeDeep;
using reference::randomSamples;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

const ChannelStats& channelOf(const ImageStats& stats, const std::string& name) {
  return *std::ranges::find(stats.channels, name, &ChannelStats::name);
}

TEST(Stats, AreThoseOfEverySample) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true, .odd = true});
    ImageStats stats;
    stats.add(image);
    for (const char* name : {"R", "A", "Z", "ZBack"}) {
      ChannelStats expected;
      expected.least = kInfinity, expected.largest = -kInfinity;
      for (const float value : image.get(name)) {
        expected.nans += std::isnan(value);
        expected.infinities += std::isinf(value);
        if (!std::isfinite(value)) continue;
        ++expected.finite;
        expected.negatives += value < 0;
        expected.sum += double(value);
        expected.least = std::min(expected.least, double(value));
        expected.largest = std::max(expected.largest, double(value));
      }
      const ChannelStats& found = channelOf(stats, name);
      EXPECT_EQ(found.nans, expected.nans) << name << " seed " << seed;
      EXPECT_EQ(found.infinities, expected.infinities) << name << " seed " << seed;
      EXPECT_EQ(found.negatives, expected.negatives) << name << " seed " << seed;
      EXPECT_EQ(found.finite, expected.finite) << name << " seed " << seed;
      EXPECT_EQ(found.least, expected.least) << name << " seed " << seed;
      EXPECT_EQ(found.largest, expected.largest) << name << " seed " << seed;
      EXPECT_NEAR(found.mean(), expected.mean(), 1e-12 * (1 + std::abs(expected.mean()))) << name << " seed " << seed;
    }
    EXPECT_EQ(channelOf(stats, "id").largest, double(std::ranges::max(image.find("id")->ids)));
  }
}

TEST(Stats, OfBandsAreThoseOfTheImage) {
  const DeepImage image = randomSamples({.window = {-3, 5, 30, 40}, .seed = 4, .volumes = true, .odd = true});
  ImageStats whole;
  whole.add(image);
  for (const int height : {1, 4, 13}) {
    ImageStats bands;
    for (int y = 5; y < 40; y += height) bands.add(rows(image, y, std::min(40, y + height)));
    ASSERT_EQ(bands.channels.size(), whole.channels.size());
    for (size_t c = 0; c < whole.channels.size(); ++c) {
      EXPECT_EQ(bands.channels[c].sum, whole.channels[c].sum) << whole.channels[c].name;
      EXPECT_EQ(bands.channels[c].least, whole.channels[c].least);
      EXPECT_EQ(bands.channels[c].finite, whole.channels[c].finite);
    }
    EXPECT_EQ(bands.samples.samples, whole.samples.samples);
    EXPECT_EQ(bands.samples.mostX, whole.samples.mostX);
    EXPECT_EQ(bands.samples.mostY, whole.samples.mostY);
    EXPECT_EQ(bands.bytes, whole.bytes);
    EXPECT_EQ(bands.untidy, whole.untidy);
  }
}

TEST(Stats, CountAlphasAndUntidyPixels) {
  const DeepImage image = makeDeep({{{1, 1, 0}, {2, 2, 1}, {3, 3, 0.5f}},
                                    {{2, 2, 1.5f}, {1, 1, -0.5f}},
                                    {{1, 1, kNan}, {1, 1, 1}},
                                    {{1, 4, 0.5f}, {2, 3, 0.5f}, {2, 2, 0.5f}, {9, 9, 0.5f}}},
                                   2);
  ImageStats stats;
  stats.add(image);
  EXPECT_EQ(stats.clear, 1u);
  EXPECT_EQ(stats.opaque, 3u);
  EXPECT_EQ(stats.badAlphas, 3u);
  EXPECT_EQ(stats.unsorted, 2u);
  EXPECT_EQ(stats.pointsCoincide, 1u);
  EXPECT_EQ(stats.volumesOverlap, 1u);
  EXPECT_EQ(stats.untidy, 3u);
  EXPECT_EQ(stats.samples.mostSamples, 4u);
  EXPECT_EQ(stats.samples.mostX, 4);
  EXPECT_EQ(stats.samples.mostY, -1);
}

TEST(Stats, OfNothing) {
  ImageStats stats;
  const DeepImage image = makeDeep({{}, {}}, 2);
  stats.add(rows(image, -2, -2));
  stats.add(image);
  EXPECT_EQ(stats.untidy, 0u);
  EXPECT_EQ(channelOf(stats, "R").mean(), 0);
}

}  // namespace
}  // namespace fathom::deep
