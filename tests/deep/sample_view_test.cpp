// Which samples stand for a pixel, against what the effective alphas of a clipped image say.
#include "deep/sample_view.h"

#include <gtest/gtest.h>

#include <random>

#include "base/error.h"
#include "deep/alpha.h"
#include "deep/clip.h"
#include "tests/reference/deep_samples.h"

namespace fathom::deep {
namespace {

using reference::makeDeep;
using reference::Pixels;

// Points and volumes behind one another, each with an id of its own.
DeepImage makeStack(unsigned seed, int pixels) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit;
  Pixels all{size_t(pixels)};
  uint32_t id = 1;
  for (auto& pixel : all) {
    float z = unit(random);
    for (int n = int(random() % 6); n > 0; --n) {
      const float length = random() % 2 ? unit(random) : 0;
      pixel.push_back({z, z + length, unit(random), 0.5f, id++});
      z += length + 0.1f;
    }
  }
  return makeDeep(all, 12);
}

uint32_t idOf(const DeepImage& image, uint64_t sample) {
  return sample == kNoSample ? 0 : image.find("id")->ids[sample];
}

// The id with the largest effective alpha of each pixel, the slow way.
std::vector<uint32_t> mostSeenIds(const DeepImage& image) {
  const Buffer<float> seen = effectiveAlpha(image);
  std::vector<uint32_t> ids;
  for (size_t pixel = 0; pixel < image.pixels(); ++pixel) {
    float most = 0;
    uint32_t id = 0;
    for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i)
      if (seen[i] > most) most = seen[i], id = image.find("id")->ids[i];
    ids.push_back(id);
  }
  return ids;
}

TEST(SampleView, TheSampleThatIsSeenMostIsThatOfTheClippedImage) {
  const DeepImage image = makeStack(1, 96);
  for (const auto& [near, far] : {std::pair(-1.0f, 99.0f), std::pair(0.7f, 1.9f), std::pair(1.2f, 99.0f)}) {
    const DeepImage clipped = clip(image, near, far);
    const std::vector<uint32_t> expected = mostSeenIds(clipped);
    const Buffer<uint64_t> found = mostSeen(image, image.dataWindow, 1, {.near = near, .far = far});
    const Buffer<uint32_t> counts = countSamples(image, image.dataWindow, 1, {.near = near, .far = far});
    for (size_t i = 0; i < image.pixels(); ++i) {
      EXPECT_EQ(idOf(image, found[i]), expected[i]) << i;
      EXPECT_EQ(counts[i], clipped.count(i)) << i;
    }
  }
}

TEST(SampleView, OrderInTheFileDoesNotMatter) {
  const DeepImage image = makeDeep({{{5, 5, 0.9f, 0, 1}, {2, 2, 0.6f, 0, 2}, {3, 3, 0.1f, 0, 3}}}, 1);
  EXPECT_EQ(idOf(image, mostSeen(image, image.dataWindow, 1, {})[0]), 2u);
  EXPECT_EQ(idOf(image, mostSeen(image, image.dataWindow, 1, {.near = 2.5f})[0]), 1u);
}

TEST(SampleView, InvertedCountsWhatIsLeftOut) {
  const DeepImage image = makeDeep({{{1, 1, 0.5f, 0, 1}, {2, 4, 0.5f, 0, 2}, {6, 6, 0.5f, 0, 3}}}, 1);
  const DepthRange range{.near = 3, .far = 7};
  DepthRange inverted = range;
  inverted.inverted = true;
  EXPECT_EQ(countSamples(image, image.dataWindow, 1, range)[0], 2u);     // half of the volume, and the last
  EXPECT_EQ(countSamples(image, image.dataWindow, 1, inverted)[0], 2u);  // the first, and the other half
}

TEST(SampleView, BoxAndStepChoosePixels) {
  const DeepImage image = makeStack(2, 96);
  const Box box{image.dataWindow.x0 - 3, image.dataWindow.y0 - 1, image.dataWindow.x1 + 2, image.dataWindow.y1};
  const Buffer<uint64_t> whole = mostSeen(image, image.dataWindow, 1, {}), part = mostSeen(image, box, 2, {});
  const Buffer<uint32_t> counts = countSamples(image, box, 2, {});
  const int width = (box.width() + 1) / 2;
  ASSERT_EQ(part.size(), size_t(width) * size_t((box.height() + 1) / 2));
  for (size_t i = 0; i < part.size(); ++i) {
    const int x = box.x0 + 2 * int(i % size_t(width)), y = box.y0 + 2 * int(i / size_t(width));
    const bool inside = image.dataWindow.contains(x, y);
    EXPECT_EQ(part[i], inside ? whole[image.dataWindow.index(x, y)] : kNoSample);
    EXPECT_EQ(counts[i], inside ? image.count(image.dataWindow.index(x, y)) : 0);
  }
}

TEST(SampleView, NearestDepthIsOfASampleWithAlpha) {
  const DeepImage image = makeDeep({{{9, 9, 0.5f}, {1, 1, 0}, {4, 4, 0.1f}}, {{1, 1, 0}}}, 2);
  EXPECT_EQ(nearestDepth(image, 3, -2), 4);
  EXPECT_EQ(nearestDepth(image, 4, -2), std::nullopt);
  EXPECT_EQ(nearestDepth(image, 99, 0), std::nullopt);
  const float infinity = std::numeric_limits<float>::infinity();
  const DeepImage sky = makeDeep({{{infinity, infinity, 1}}, {{-infinity, 1, 1}, {7, 7, 1}}}, 2);
  EXPECT_EQ(nearestDepth(sky, 3, -2), std::nullopt);
  EXPECT_EQ(nearestDepth(sky, 4, -2), 7);
}

TEST(SampleView, AMissingChannelIsNamed) {
  DeepImage image = makeDeep({{{9, 9, 0.5f}}}, 1);
  image.erase("A");
  EXPECT_THROW(mostSeen(image, image.dataWindow, 1, {}), Error);
}

}  // namespace
}  // namespace fathom::deep
