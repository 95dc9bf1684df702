// Ten thousand samples in a pixel: right, and in a time that does not grow with their square.
#include <gtest/gtest.h>

#include <ctime>
#include <functional>

#include "deep/clip.h"
#include "deep/clip_view.h"
#include "deep/cluster.h"
#include "deep/flatten.h"
#include "deep/ops/compress.h"
#include "deep/ops/fog.h"
#include "deep/ops/grade.h"
#include "deep/ops/holdout.h"
#include "deep/ops/ids.h"
#include "deep/ops/limit.h"
#include "deep/ops/merge.h"
#include "deep/ops/plus.h"
#include "deep/ops/recolour.h"
#include "deep/ops/resize.h"
#include "deep/ops/sample.h"
#include "deep/tidy.h"
#include "tests/stress/exact_pixel.h"
#include "tests/stress/extreme_deep.h"
#include "tests/stress/worst.h"

namespace fathom::stress {
namespace {

using deep::DeepImage;

constexpr unsigned kMany = 10000;

// One pixel of `samples` that are hardly there, points or volumes of which a few overlap.
DeepImage manySamples(unsigned samples, bool volumes) {
  DeepImage image =
      extremeDeep({.window = {0, 0, 1, 1}, .most = samples, .empty = 0, .volumes = volumes, .longest = 0.02f}, 3);
  for (float& alpha : image.get("A")) alpha *= 0.002f;
  return image;
}

struct Timed {
  std::string name;
  std::function<void(const DeepImage&)> run;
};
std::vector<Timed> operations() {
  const auto flatten = [](const DeepImage& image) { (void)deep::flatten(image); };
  return {
      {"flatten", flatten},
      {"tidy", [=](const DeepImage& a) { flatten(deep::tidy(a.copy()).image); }},
      {"merge",
       [=](const DeepImage& a) {
         std::vector<DeepImage> both;
         both.push_back(a.copy()), both.push_back(a.copy());
         flatten(deep::merge(both));
       }},
      {"clip", [](const DeepImage& a) { (void)deep::clip(a, 3, 9); }},
      {"clip view",
       [](const DeepImage& a) {
         (void)deep::clipView(a, {0, 0, 1, 1}, 1, {3, 9, 1}, {"G", "Z"});
       }},
      {"holdout", [](const DeepImage& a) { (void)deep::holdout(a.copy(), a); }},
      {"plus", [](const DeepImage& a) { (void)deep::plus(a.copy(), a.copy()); }},
      {"limit", [](const DeepImage& a) { (void)deep::limit(a.copy(), 10); }},
      {"compress", [](const DeepImage& a) { (void)deep::compress(a.copy(), {.error = 0.001}); }},
      {"resize", [](const DeepImage& a) { (void)deep::resize(a.copy(), 8, 6, deep::Filter::Bilinear); }},
      {"fog", [](const DeepImage& a) { (void)deep::applyFog(a.copy(), {.near = 1, .far = 50, .density = 0.1}); }},
      {"grade",
       [](const DeepImage& a) {
         (void)deep::grade(a.copy(), {.gamma = {2, 2, 2}});
       }},
      {"ids", [](const DeepImage& a) { (void)deep::rankIds(a, "id", 8); }},
      {"sample", [](const DeepImage& a) { (void)deep::lightOf(a, 0, 0); }},
      {"cluster", [](const DeepImage& a) { (void)deep::cluster(a, deep::findBins(a, 700)); }},
  };
}

// Of the processor, the least of several times: what else the machine does matters little.
double secondsOf(const Timed& operation, const DeepImage& image, int runs) {
  double least = HUGE_VAL;
  for (int i = 0; i < 5; ++i) {
    const std::clock_t begin = std::clock();
    for (int run = 0; run < runs; ++run) operation.run(image);
    least = std::min(least, double(std::clock() - begin) / CLOCKS_PER_SEC);
  }
  return least;
}

TEST(StressMany, TakesNoTimeThatGrowsWithTheirSquare) {
  constexpr int kTimes = 16;
  for (const bool volumes : {false, true}) {
    const DeepImage many = manySamples(kMany, volumes), few = manySamples(kMany / kTimes, volumes);
    for (const Timed& operation : operations()) {
      // As long as so many runs of fewer samples, or 1.5 times that with a logarithm; 16 times if it were their square.
      const double seconds = secondsOf(operation, many, 1), apart = secondsOf(operation, few, kTimes);
      EXPECT_LT(seconds, 6 * apart + 0.002) << operation.name << (volumes ? " of volumes" : " of points");
    }
  }
}

TEST(StressMany, AreComposited) {
  Worst light("flatten: colour", 0x1.01p-24), tidied("tidy: light", 0x1.1p-23), limited("limit: light", 0x1.1p-23);
  for (const bool volumes : {false, true}) {
    const DeepImage image = manySamples(kMany, volumes), tidy = deep::tidy(image.copy()).image;
    const DeepImage ten = deep::limit(image.copy(), 10);
    const auto values = valuesOf(image, 0, "G");
    const Real expected = exactPixel(image, 0).light(values, kForever, true), scale = magnitude(values);
    light.put("10,000 samples", 3, 0, deep::flatten(image).get("G").values[0], expected, scale);
    tidied.put("10,000 samples", 3, 0, exactPixel(tidy, 0).light(valuesOf(tidy, 0, "G"), kForever, true), expected,
               scale);
    limited.put("10,000 samples", 3, 0, exactPixel(ten, 0).light(valuesOf(ten, 0, "G"), kForever, true), expected,
                scale);
    EXPECT_EQ(ten.count(0), 10u);
  }
}

}  // namespace
}  // namespace fathom::stress
