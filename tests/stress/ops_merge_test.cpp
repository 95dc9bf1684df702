// Tidying, merging, holding out and adding at the ends of the numbers, seen up to every depth.
#include <gtest/gtest.h>

#include "deep/flatten.h"
#include "deep/ops/holdout.h"
#include "deep/ops/merge.h"
#include "deep/ops/plus.h"
#include "deep/tidy.h"
#include "flat/finite.h"
#include "tests/reference/random_deep.h"
#include "tests/stress/curves.h"

namespace fathom::stress {
namespace {

using deep::DeepImage;

// A sample's alpha is rounded to a float, by at most 2^-24 of itself. What passes to a depth is then off by the sum over
// the samples before it of (what reaches them) * (their alpha) * 2^-24, which is 2^-24 of what is seen at most. Light is
// off by as much of the light behind it, and once more since it is rounded itself; of what is held out, its factor is, too.
constexpr double kPassing = 0x1.1p-24, kLight = 0x1.1p-23, kHeldOut = 0x1.1p-22;

DeepImage another(const Frame& frame) {
  ExtremeParams params = frame.params;
  params.window = moved(params.window, 1, -1);  // a part outside of the other one
  return extremeDeep(params, frame.seed + 5000);
}

// The samples of several images at a pixel of the first, and how many are of that.
struct Together {
  ExactPixel exact;
  std::vector<float> values;
  size_t own;
};
Together together(const DeepImage& image, const DeepImage& other, size_t pixel) {
  const int width = image.dataWindow.width();
  const int x = image.dataWindow.x0 + int(pixel) % width, y = image.dataWindow.y0 + int(pixel) / width;
  std::vector<Medium> media = mediaOf(image, pixel);
  const auto own = valuesOf(image, pixel, "G");
  std::vector<float> values(own.begin(), own.end());
  const size_t count = media.size();
  if (other.dataWindow.contains(x, y)) {
    const size_t at = other.dataWindow.index(x, y);
    for (const Medium& medium : mediaOf(other, at)) media.push_back(medium);
    const auto more = valuesOf(other, at, "G");
    values.insert(values.end(), more.begin(), more.end());
  }
  return {ExactPixel(std::move(media)), std::move(values), count};
}

TEST(StressTidy, ShowsWhatItIsMadeOf) {
  Worst light("tidy: light", kLight), passing("tidy: transmittance", kPassing);
  Worst plain("tidy: coc", kLight);
  forEachFrame([&](const Frame& frame) {
    const DeepImage tidied = deep::tidy(frame.image.copy()).image;
    EXPECT_TRUE(deep::isTidy(tidied)) << frame.name << ", seed " << frame.seed;
    compareImages(frame, tidied, frame.image, light, passing);
    comparePlain(frame, tidied, frame.image, plain);
  });
}

TEST(StressTidy, TwiceIsOnce) {
  forEachFrame([](const Frame& frame) {
    const DeepImage once = deep::tidy(frame.image.copy()).image;
    EXPECT_EQ(reference::difference(once, deep::tidy(once.copy()).image), "") << frame.name << ", seed " << frame.seed;
  });
}

TEST(StressTidy, EqualDepthsKeepTheirOrder) {
  const ExtremeParams params{.window = {0, 0, 3, 2}, .most = 500, .empty = 0, .coincident = true};
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const DeepImage image = extremeDeep(params, seed), sorted = deep::sortSamples(image.copy());
    for (size_t p = 0; p < image.pixels(); ++p) {
      const auto z = valuesOf(image, p, "Z"), zBack = valuesOf(image, p, "ZBack"), coc = valuesOf(image, p, "coc");
      std::vector<size_t> order(z.size());
      for (size_t i = 0; i < order.size(); ++i) order[i] = i;
      std::ranges::stable_sort(order, {}, [&](size_t i) { return std::pair(z[i], zBack[i]); });
      for (size_t i = 0; i < order.size(); ++i)
        EXPECT_EQ(valuesOf(sorted, p, "coc")[i], coc[order[i]]) << "pixel " << p;
    }
  }
}

TEST(StressMerge, ShowsBoth) {
  Worst light("merge: light", 0x1.01p-24);  // flattened, as that rounds
  forEachFrame([&](const Frame& frame) {
    std::vector<DeepImage> both;
    both.push_back(frame.image.copy());
    both.push_back(another(frame));
    const DeepImage merged = deep::merge(both);
    EXPECT_FALSE(deep::findUntidiness(merged).unsorted);
    const flat::Image flat = deep::flatten(merged);
    const Box& window = frame.image.dataWindow;
    light.touch(frame.name);
    for (size_t p = 0; p < frame.image.pixels(); ++p) {
      const Together all = together(both[0], both[1], p);
      const size_t to =
          merged.dataWindow.index(window.x0 + int(p) % window.width(), window.y0 + int(p) / window.width());
      EXPECT_EQ(merged.count(to), all.values.size());
      const Real expected = std::clamp<Real>(all.exact.light(all.values, kForever, true), -kLargest, kLargest);
      light.put(frame.name, frame.seed, p, flat.get("G").values[to], expected, magnitude(all.values));
    }
  });
}

TEST(StressHoldout, ShowsWhatIsSeenInTheMerge) {
  Worst light("holdout: light", kHeldOut), passing("holdout: alpha", kHeldOut), matte("holdout: matte", 0x1.1p-23);
  forEachFrame([&](const Frame& frame) {
    const DeepImage other = another(frame), held = deep::holdout(frame.image.copy(), other);
    const flat::Image part = deep::holdoutMatte(frame.image, other);
    light.touch(frame.name), passing.touch(frame.name), matte.touch(frame.name);
    for (size_t p = 0; p < frame.image.pixels(); ++p) {
      const Together all = together(frame.image, other, p);
      const auto own = [&](Real until, bool whole) {
        std::vector<float> values(all.values);
        std::fill(values.begin() + ptrdiff_t(all.own), values.end(), 0.0f);
        return all.exact.light(values, until, whole);
      };
      const auto seen = [&](Real until, bool whole) {
        Real sum = 0;
        const std::vector<Real> alphas = all.exact.seen(until, whole);
        for (size_t i = 0; i < all.own; ++i) sum += alphas[i];
        return sum;
      };
      compareCurves(
          {frame, p}, exactPixel(held, p), valuesOf(held, p, "G"), magnitude(valuesOf(frame.image, p, "G")), own,
          [&](Real until) { return 1 - seen(until, false); }, light, passing);
      const Real alpha = exactPixel(frame.image, p).alphaOfAll();
      if (alpha > 1e-30L) matte.put(frame.name, frame.seed, p, part.get("A").values[p], seen(kForever, true) / alpha);
    }
  });
}

TEST(StressHoldout, HardOnesKeepWhatIsInFrontOfAnAlpha) {
  for (const double opaque : {1e-6, 0.5, 0.999})
    forEachFrame([&](const Frame& frame) {
      const DeepImage other = another(frame), kept = deep::hardHoldout(frame.image, other, opaque);
      for (size_t p = 0; p < frame.image.pixels(); ++p) {
        const Box& window = frame.image.dataWindow;
        const int x = window.x0 + int(p) % window.width(), y = window.y0 + int(p) / window.width();
        const bool covered = other.dataWindow.contains(x, y);
        const ExactPixel hides = covered ? exactPixel(other, other.dataWindow.index(x, y)) : ExactPixel({});
        size_t certain = 0, possible = 0;
        for (const Medium& medium : mediaOf(frame.image, p)) {
          const Real left = hides.passing(medium.z) - (1 - Real(opaque));
          certain += left > 1e-7L;
          possible += left > -1e-7L;
        }
        EXPECT_GE(kept.count(p), certain) << frame.name << ", seed " << frame.seed << ", pixel " << p;
        EXPECT_LE(kept.count(p), possible) << frame.name << ", seed " << frame.seed << ", pixel " << p;
      }
    });
}

TEST(StressPlus, AddsTheLightThatIsSeen) {
  Worst light("plus: light", kHeldOut), passing("plus: transmittance", 0);
  forEachFrame([&](const Frame& frame) {
    const DeepImage shine = deep::emission(frame.image.copy());
    light.touch(frame.name);
    for (size_t p = 0; p < frame.image.pixels(); ++p) {
      const ExactPixel whole = exactPixel(frame.image, p);
      const auto values = valuesOf(frame.image, p, "G");
      compareCurves(
          {frame, p}, exactPixel(shine, p), valuesOf(shine, p, "G"), magnitude(values),
          [&](Real until, bool all) { return whole.light(values, until, all); }, [](Real) { return Real(1); }, light,
          passing);
    }
    const DeepImage sum = deep::plus(frame.image.copy(), another(frame));
    const flat::Image flat = deep::flatten(sum), alone = deep::flatten(frame.image);
    const Box& window = frame.image.dataWindow;
    for (int y = window.y0; y < window.y1; ++y)
      for (int x = window.x0; x < window.x1; ++x)
        EXPECT_EQ(flat.get("A").values[flat.dataWindow.index(x, y)], alone.get("A").values[window.index(x, y)]);
  });
}

}  // namespace
}  // namespace fathom::stress
