#include "deep/depth_histogram.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <numeric>
#include <random>

#include "base/error.h"
#include "base/progress.h"
#include "deep/flatten.h"
#include "tests/reference/deep_samples.h"

namespace fathom::deep {
namespace {

using reference::makeDeep;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

double total(const std::vector<double>& bins) {
  return std::accumulate(bins.begin(), bins.end(), 0.0);
}

// Points and volumes that follow each other, in rows of three pixels.
reference::Pixels stacks(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit;
  reference::Pixels pixels(60);
  for (auto& pixel : pixels) {
    float z = 0.1f + unit(random);
    for (int n = int(random() % 6); n > 0; --n) {
      const float length = random() % 2 ? 3 * unit(random) : 0;
      pixel.push_back({z, z + length, random() % 4 ? unit(random) : 1, 0});
      z += length + 0.1f + unit(random);
    }
  }
  return pixels;
}

// One sample after the other and one bin after the other.
std::vector<double> slowHistogram(const reference::Pixels& pixels, const DepthAxis& axis, int bins,
                                  DepthWeight weight) {
  std::vector<double> result(size_t(bins), 0.0);
  for (const auto& pixel : pixels) {
    double passed = 1;
    for (const auto& sample : pixel) {
      const double here = weight == DepthWeight::Seen ? passed * double(sample.alpha) : 1;
      passed *= 1 - double(sample.alpha);
      for (int i = 0; i < bins; ++i) {
        const double begin = axis.depth(double(i) / bins), end = axis.depth((i + 1.0) / bins);
        const auto z = double(sample.z), zBack = double(sample.zBack);
        const double share = z == zBack ? (z >= begin && z < end ? 1 : 0)
                                        : std::max(0.0, std::min(end, zBack) - std::max(begin, z)) / (zBack - z);
        result[size_t(i)] += share * here;
      }
    }
  }
  return result;
}

TEST(DepthHistogram, IsWhatASlowOneSays) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const reference::Pixels pixels = stacks(seed);
    const DeepImage image = makeDeep(pixels, 3);
    for (const DepthAxis& axis :
         {DepthAxis{-0.3, 20.7}, DepthAxis{1.1, 2.9}, DepthAxis{0.05, 30, true}, DepthAxis{1.1, 2.9, true}})
      for (const DepthWeight weight : {DepthWeight::Seen, DepthWeight::Samples}) {
        const auto found = depthHistogram(image, axis, 37, weight), slow = slowHistogram(pixels, axis, 37, weight);
        ASSERT_EQ(found.size(), 37u);
        for (size_t i = 0; i < 37; ++i) EXPECT_NEAR(found[i], slow[i], 1e-9) << "bin " << i << ", seed " << seed;
      }
  }
}

// Whichever way their places are rounded: in 25 bins up to 25, that of 7 is rounded up, in 22 that of 15 down.
TEST(DepthHistogram, PointsOnBordersAreWhereASlowOneHasThem) {
  for (int bins = 1; bins <= 60; ++bins)
    for (const DepthAxis& axis : {DepthAxis{0, double(bins)}, DepthAxis{-1, 2.5}, DepthAxis{0.01, 100, true}}) {
      reference::Pixels pixels(1);
      for (int i = 0; i < bins; ++i) {
        const auto z = float(axis.depth(double(i) / bins));
        for (const float at : {std::nextafter(z, -kInfinity), z, std::nextafter(z, kInfinity)})
          pixels[0].push_back({at, at, 0.5f});
      }
      EXPECT_EQ(depthHistogram(makeDeep(pixels, 1), axis, bins, DepthWeight::Samples),
                slowHistogram(pixels, axis, bins, DepthWeight::Samples))
          << bins << " bins from " << axis.near;
    }
}

// Nine decades, and a twenty-fifth of that on both sides.
TEST(DepthHistogram, ALogarithmicAxisEndsNineDecadesBeforeTheLastDepth) {
  const DepthAxis axis = axisOf(makeDeep({{{1e-12f, 1e-12f, 0.5f}, {0, 0, 0.5f}, {100, 100, 1}}}, 1), true);
  EXPECT_NEAR(std::log10(axis.near), -7 - 0.36, 1e-6);
  EXPECT_NEAR(std::log10(axis.far), 2 + 0.36, 1e-6);
}

TEST(DepthHistogram, OfAllDepthsSumsUpToAlphaAndSamples) {
  const DeepImage image = makeDeep(stacks(9), 3);
  double alpha = 0;
  const flat::Image flattened = flatten(image);
  for (const float a : flattened.get("A").values) alpha += double(a);
  for (const bool logarithmic : {false, true}) {
    const DepthAxis axis = axisOf(image, logarithmic);
    EXPECT_NEAR(total(depthHistogram(image, axis, 100, DepthWeight::Seen)), alpha, 1e-5);
    EXPECT_NEAR(total(depthHistogram(image, axis, 100, DepthWeight::Samples)), double(image.samples()), 1e-9);
  }
}

TEST(DepthHistogram, AVolumeIsSpreadAlongItsLength) {
  const DeepImage image = makeDeep({{{2, 6, 0.5f}}}, 1);
  const auto bins = depthHistogram(image, {0, 8}, 4, DepthWeight::Seen);
  for (const size_t bin : {0u, 3u}) EXPECT_EQ(bins[bin], 0);
  for (const size_t bin : {1u, 2u}) EXPECT_NEAR(bins[bin], 0.25, 1e-12);
}

TEST(DepthHistogram, InfiniteDepthsAreLeftOut) {
  const DeepImage image = makeDeep({{{1, 1, 0.5f}, {2, 2, 0.5f}, {kInfinity, kInfinity, 1}}}, 1);
  const DepthAxis axis = axisOf(image, false);
  EXPECT_NEAR(axis.near, 1, 0.1);
  EXPECT_NEAR(axis.far, 2, 0.1);
  EXPECT_NEAR(total(depthHistogram(image, {0, 3}, 5, DepthWeight::Seen)), 0.75, 1e-12);
  EXPECT_NEAR(total(depthHistogram(image, {1, 2}, 5, DepthWeight::Seen)), 0.75, 1e-12);
}

TEST(DepthHistogram, AnswersForImagesWithoutDepths) {
  const DeepImage nothing = makeDeep({{}, {}}, 2), one = makeDeep({{{4, 4, 1}}}, 1),
                  before = makeDeep({{{-2, 0, 1}}}, 1);
  for (const bool logarithmic : {false, true}) EXPECT_EQ(axisOf(nothing, logarithmic), DepthAxis());
  EXPECT_EQ(axisOf(before, true), DepthAxis());
  EXPECT_EQ(total(depthHistogram(nothing, {}, 8, DepthWeight::Seen)), 0);
  for (const bool logarithmic : {false, true}) {
    const DepthAxis axis = axisOf(one, logarithmic);
    EXPECT_LT(axis.near, 4);
    EXPECT_GT(axis.far, 4);
    EXPECT_EQ(total(depthHistogram(one, axis, 8, DepthWeight::Seen)), 1);
  }
}

TEST(DepthHistogram, HasTheSameBitsForAnyNumberOfThreadsAndCanBeStopped) {
  const DeepImage image = makeDeep(stacks(2), 3);
  const auto histogram = [&](size_t threads) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    return depthHistogram(image, axisOf(image, true), 50, DepthWeight::Seen);
  };
  EXPECT_EQ(histogram(1), histogram(4));
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(depthHistogram(image, {}, 8, DepthWeight::Seen, stop.get_token()), Cancelled);
}

TEST(DepthHistogram, NamesTheChannelThatIsMissing) {
  DeepImage image = makeDeep(stacks(1), 3);
  image.erase("A");
  EXPECT_THROW(depthHistogram(image, {}, 8, DepthWeight::Seen), Error);
  EXPECT_NO_THROW(depthHistogram(image, {}, 8, DepthWeight::Samples));
  image.erase("Z");
  EXPECT_THROW(axisOf(image, false), Error);
}

}  // namespace
}  // namespace fathom::deep
