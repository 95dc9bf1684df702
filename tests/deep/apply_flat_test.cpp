#include "deep/apply_flat.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/one_bin.h"
#include "tests/reference/noisy_frame.h"

namespace fathom::deep {
namespace {

// One opaque bin a pixel, as a flat file is read.
DeepImage pixels() {
  DeepImage image = fromFlat(flatten(reference::makeNoisyFrame(9, 7, 1)));
  image.add("half0.R", PixelType::Float).values.fill(1);
  makeOneBin(image);
  return image;
}

flat::Image halved(const flat::Image& noisy, const Progress&) {
  flat::Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
  for (const char* name : {"R", "G", "B"}) {
    flat::Plane& plane = result.add(name);
    for (size_t i = 0; i < plane.values.size(); ++i) plane.values[i] = noisy.get(name).values[i] / 2;
  }
  return result;
}

TEST(ApplyFlat, ReplacesTheColourAndDropsWhatItVoids) {
  const DeepImage before = pixels();
  const DeepImage after = applyFlat(before.copy(), halved, false);
  for (const Channel& channel : before.channels) {
    const std::string& name = channel.name;
    const Channel* found = after.find(name);
    if (name.starts_with("diffuse.") || name.starts_with("specular.") || name.starts_with("half")) {
      EXPECT_FALSE(found) << name;
      continue;
    }
    ASSERT_TRUE(found) << name;
    const float factor = name == "R" || name == "G" || name == "B" ? 0.5f : 1.0f;
    for (size_t i = 0; i < channel.values.size(); ++i) EXPECT_EQ(found->values[i], factor * channel.values[i]) << name;
  }
  EXPECT_TRUE(applyFlat(before.copy(), halved, true).find("half0.R"));
}

TEST(ApplyFlat, ShowsThePixelsOwnAlpha) {
  DeepImage image = pixels();
  unmakeOneBin(image);
  const std::vector<float> alpha(image.get("A").begin(), image.get("A").end());
  makeOneBin(image);
  const auto denoiser = [&](const flat::Image& noisy, const Progress& progress) {
    const Buffer<float>& seen = noisy.get("A").values;
    EXPECT_TRUE(std::equal(alpha.begin(), alpha.end(), seen.begin(), seen.end()));
    EXPECT_EQ(noisy.attributes.at("fathom:spp"), "24");
    return halved(noisy, progress);
  };
  image.attributes.set("fathom:spp", 24);
  const DeepImage after = applyFlat(std::move(image), denoiser, false);
  EXPECT_EQ(after.get("A")[0], 1);
}

TEST(ApplyFlat, CountsAndThrowsOn) {
  DeepImage image = pixels();
  for (const char* name : {"G", "B"}) image.find(name)->values[3] = NAN;
  image.find("B")->values[4] = NAN;
  DenoiseStats stats;
  applyFlat(image.copy(), halved, false, {}, &stats);
  EXPECT_EQ(stats.counts.at("pixels"), 63u);
  EXPECT_EQ(stats.counts.at("non-finite samples"), 2u);
  EXPECT_TRUE(stats.seconds.contains("base"));
  EXPECT_THROW(applyFlat(
                   image.copy(), [](const flat::Image&, const Progress&) -> flat::Image { fail("no"); }, false),
               Error);
}

}  // namespace
}  // namespace fathom::deep
