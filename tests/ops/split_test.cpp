// What clip cuts apart and merge puts together again is the whole.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "deep/clip.h"
#include "deep/flatten.h"
#include "deep/ops/merge.h"
#include "deep/tidy.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;

TEST(Split, AtManyPlanesChangesTheFlattenedImageByRoundingOnly) {
  for (unsigned seed = 1; seed <= 30; ++seed) {
    const DeepImage image = tidy(randomSamples({.seed = seed, .volumes = true, .sorted = false})).image;
    const flat::Image whole = flatten(image);
    std::mt19937 random(seed);
    for (const size_t count : {1u, 2u, 7u, 40u}) {
      std::vector<float> planes{-std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity()};
      while (planes.size() < count + 2) planes.push_back(1 + float(random() % 10000) * 1e-3f);
      std::sort(planes.begin(), planes.end());
      std::vector<DeepImage> slabs;
      for (size_t i = 0; i + 1 < planes.size(); ++i) slabs.push_back(clip(image, planes[i], planes[i + 1]));
      const flat::Image again = flatten(merge(slabs));
      for (const char* name : {"R", "G", "B", "A"})
        for (size_t p = 0; p < image.pixels(); ++p) {
          const float value = whole.get(name).values[p];
          ASSERT_NEAR(again.get(name).values[p], value, double(count) * 0x1p-22 * std::max(1.0f, std::abs(value)))
              << name << " of pixel " << p << ", " << count << " planes, seed " << seed;
        }
    }
  }
}

TEST(Split, IdentifiersOfBothPartsAreTheVolumes) {
  const DeepImage image = tidy(randomSamples({.seed = 3, .volumes = true})).image;
  std::vector<DeepImage> parts;
  parts.push_back(clip(image, -1e9f, 3));
  parts.push_back(clip(image, 3, 1e9f));
  const auto idsOf = [](const DeepImage& of) {
    std::vector<uint32_t> ids(of.find("id")->ids.begin(), of.find("id")->ids.end());
    std::sort(ids.begin(), ids.end());
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    return ids;
  };
  EXPECT_EQ(idsOf(merge(parts)), idsOf(image));
}

}  // namespace
}  // namespace fathom::deep
