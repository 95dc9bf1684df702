// Values beyond what HALF holds, on their way through a file.
#include <gtest/gtest.h>

#include "deep/flatten.h"
#include "deep/io.h"
#include "deep/tidy.h"
#include "tests/reference/temporary_folder.h"
#include "tests/stress/exact_pixel.h"
#include "tests/stress/extreme_deep.h"
#include "tests/stress/worst.h"

namespace fathom::stress {
namespace {

using deep::DeepImage;

// The image with HALF colours.
DeepImage withHalves(DeepImage image) {
  for (const char* name : {"R", "G", "B"}) image.find(name)->type = deep::PixelType::Half;
  return image;
}

TEST(StressHalf, WhatIsTooLargeEndsAtItsLargest) {
  const TemporaryFolder folder;
  DeepImage image = withHalves(extremeDeep({.window = {0, 0, 4, 1}, .most = 1, .empty = 0}, 1));
  const float given[] = {1.3e5f, -1e15f, kInfinity, 65504}, expected[] = {65504, -65504, kInfinity, 65504};
  std::ranges::copy(given, image.get("R").begin());
  deep::write(folder / "a.exr", image);
  EXPECT_TRUE(std::ranges::equal(deep::read(folder / "a.exr").get("R"), expected));
}

// Merged light of two halves may be more than one holds: it ends there, and does not vanish.
TEST(StressHalf, TidiedAndWrittenTheLightIsThere) {
  // HALF has 11 bits; below 2^-14 steps of 2^-24.
  Worst light("tidy, then HALF: light", 0x1p-11);
  const TemporaryFolder folder;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const ExtremeParams params{.most = 6, .values = true, .coincident = true, .largest = 65504};
    const DeepImage image = withHalves(extremeDeep(params, seed));
    deep::write(folder / "a.exr", deep::tidy(image.copy()).image);
    const DeepImage found = deep::read(folder / "a.exr");
    for (size_t p = 0; p < found.pixels(); ++p) {
      const auto values = valuesOf(image, p, "G");
      light.put("values to 65504", seed, p, exactPixel(found, p).light(valuesOf(found, p, "G"), kForever, true),
                exactPixel(image, p).light(values, kForever, true),
                magnitude(values) + Real(0x1p-14) * Real(found.count(p)));
    }
  }
}

}  // namespace
}  // namespace fathom::stress
