// Merging: nothing is lost, the order is by depth, and what an image lacks is filled.
#include "deep/ops/merge.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "deep/channels.h"
#include "deep/flatten.h"
#include "deep/ops/crop.h"
#include "tests/reference/random_ops.h"

namespace fathom::deep {
namespace {

using reference::randomSamples;

TEST(Merge, HoldsEverySampleOfEveryInputFrontToBack) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::vector<DeepImage> inputs;
    for (unsigned i = 0; i < 1 + seed % 4; ++i)
      inputs.push_back(
          randomSamples({.window = {int(i) * 3, -2, 9 + int(i), 6}, .seed = 100 * seed + i, .volumes = i % 2 == 0}));
    const DeepImage merged = merge(inputs);
    size_t samples = 0;
    for (const DeepImage& image : inputs) samples += image.samples();
    ASSERT_EQ(merged.samples(), samples) << "seed " << seed;
    const std::span<const float> z = merged.get("Z");
    for (size_t p = 0; p < merged.pixels(); ++p)
      for (size_t s = merged.offsets[p]; s + 1 < merged.offsets[p + 1]; ++s)
        ASSERT_LE(z[s], z[s + 1]) << "seed " << seed;
  }
}

TEST(Merge, FlattenedDoesNotDependOnTheOrder) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::vector<DeepImage> inputs;
    for (unsigned i = 0; i < 3; ++i) inputs.push_back(randomSamples({.seed = 100 * seed + i, .volumes = true}));
    const flat::Image forth = flatten(merge(inputs));
    std::swap(inputs[0], inputs[2]);
    const flat::Image back = flatten(merge(inputs));
    for (const char* name : {"R", "G", "B", "A"})
      for (size_t i = 0; i < forth.get(name).values.size(); ++i) {
        const float a = forth.get(name).values[i], b = back.get(name).values[i];
        ASSERT_NEAR(a, b, 1e-5 * std::max(1.0f, std::abs(a))) << name << ", seed " << seed;
      }
  }
}

TEST(Merge, OfDisjointWindowsIsBoth) {
  std::vector<DeepImage> inputs;
  inputs.push_back(randomSamples({.window = {0, 0, 4, 3}, .seed = 1}));
  inputs.push_back(randomSamples({.window = {10, 7, 15, 9}, .seed = 2}));
  const DeepImage merged = merge(inputs);
  EXPECT_EQ(merged.dataWindow, (Box{0, 0, 15, 9}));
  for (const DeepImage& input : inputs)
    EXPECT_EQ(reference::difference(toWindow(merged, input.dataWindow), input), "display window");
}

TEST(Merge, FillsWhatAnImageLacks) {
  std::vector<DeepImage> inputs;
  inputs.push_back(randomSamples({.seed = 1, .volumes = true}));
  inputs.push_back(randomSamples({.seed = 2}));
  inputs[1].erase("G");
  inputs[1].add("variance.R", PixelType::Float);
  inputs[1].add("mask", PixelType::Uint).ids.fill(7);
  const DeepImage merged = merge(inputs);
  EXPECT_FALSE(merged.find("variance.R"));
  size_t sevens = 0;
  for (size_t s = 0; s < merged.samples(); ++s) {
    if (merged.find("mask")->ids[s] != 7) continue;
    ++sevens;
    EXPECT_EQ(merged.get("G")[s], 0);
    EXPECT_EQ(merged.get("ZBack")[s], merged.get("Z")[s]);
  }
  EXPECT_EQ(sevens, inputs[1].samples());
  const std::vector<std::string> lines = describeMerge(inputs);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0], "0 where an image does not have it: G mask");
  EXPECT_EQ(lines[1], "left out, since not every image has it: variance.*");
}

TEST(Merge, TakesTheWiderTypeAndDropsWhatCountedTheSamples) {
  std::vector<DeepImage> inputs;
  for (unsigned i = 0; i < 2; ++i) {
    inputs.push_back(randomSamples({.seed = 1 + i}));
    inputs[i].find("G")->type = i == 0 ? PixelType::Half : PixelType::Float;
    inputs[i].attributes.set("fathom:spp", 4);
  }
  const DeepImage merged = merge(inputs);
  EXPECT_EQ(merged.find("G")->type, PixelType::Float);
  EXPECT_FALSE(merged.attributes.getInt("fathom:spp"));
}

TEST(Merge, RefusesAChannelThatIsUintInOneImageOnly) {
  std::vector<DeepImage> inputs;
  inputs.push_back(randomSamples({.seed = 1}));
  inputs.push_back(randomSamples({.seed = 2}));
  inputs[0].add("mask", PixelType::Uint).ids.fill(1);
  inputs[1].add("mask", PixelType::Float).values.fill(1);
  EXPECT_THROW(merge(inputs), Error);
}

}  // namespace
}  // namespace fathom::deep
