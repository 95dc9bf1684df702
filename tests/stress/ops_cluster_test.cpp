// Camera samples at the ends of the numbers become bins; and bins are compared with bins.
#include <gtest/gtest.h>

#include <cfloat>

#include "deep/alpha.h"
#include "deep/cluster.h"
#include "deep/compare.h"
#include "deep/tidy.h"
#include "tests/stress/curves.h"

namespace fathom::stress {
namespace {

using deep::DeepImage;

// Camera samples: the k-th of n has the alpha 1 / (n - k), so that each is seen as much as the others; some rays saw
// nothing.
DeepImage cameraSamples(const Frame& frame, std::vector<int>& rays) {
  DeepImage image = extremeDeep(frame.params, frame.seed);
  image.erase("ZBack");
  image = deep::sortSamples(std::move(image));
  std::mt19937 random(frame.seed);
  for (size_t p = 0; p < image.pixels(); ++p) {
    const int count = int(image.count(p)), n = count + int(random() % 3);
    rays.push_back(n);
    for (int k = 0; k < count; ++k) {
      const size_t s = image.offsets[p] + size_t(k);
      const float alpha = image.get("A")[s] = float(1.0 / (n - k));
      for (const char* name : {"R", "G", "B"}) image.get(name)[s] *= alpha;
    }
  }
  return image;
}

// What a bin is to be, in long double, from the samples that are nearest to it.
struct Expected {
  Real mean = 0, variance = 0, scatter = 0, largest = 0;
  size_t count = 0;
};
std::vector<Expected> expectedBins(const DeepImage& samples, size_t pixel, std::span<const float> bins) {
  std::vector<std::vector<Real>> members(bins.size());
  const auto z = valuesOf(samples, pixel, "Z"), values = valuesOf(samples, pixel, "G"),
             alpha = valuesOf(samples, pixel, "A");
  for (size_t i = 0; i < z.size(); ++i) {
    const Real depth = std::min(z[i], FLT_MAX);
    size_t best = 0;
    for (size_t b = 1; b < bins.size(); ++b)
      if (std::abs(bins[b] - depth) < std::abs(bins[best] - depth)) best = b;
    members[best].push_back(Real(values[i]) / Real(alpha[i]));
  }
  std::vector<Expected> result(bins.size());
  for (size_t b = 0; b < bins.size(); ++b) {
    Expected& bin = result[b];
    const Real n = Real(members[b].size());
    bin.count = members[b].size();
    for (const Real value : members[b]) bin.mean += value / n, bin.largest = std::max(bin.largest, value);
    for (const Real value : members[b]) bin.scatter += (value - bin.mean) * (value - bin.mean);
    if (n > 1) bin.variance = bin.scatter / (n - 1) / n;
  }
  return result;
}

TEST(StressCluster, MeansAndVariancesOfCameraSamples) {
  // Means are sums in double of values over alphas, once rounded, times the bin's alpha, itself a float. A variance is that
  // of values that are floats over floats: relative to the largest value it is known to that.
  Worst alpha("cluster: alpha", 0x1.1p-24), mean("cluster: mean", 0x1.1p-23), variance("cluster: variance", 0x1.1p-22);
  Worst halves("cluster: halves", 0x1.1p-22);
  forEachFrame([&](const Frame& frame) {
    if (frame.params.volumes) return;
    std::vector<int> rays;
    const DeepImage samples = cameraSamples(frame, rays);
    const DeepImage found = deep::cluster(samples, deep::findBins(samples, 700));
    for (Worst* worst : {&alpha, &mean, &variance, &halves}) worst->touch(frame.name);
    for (size_t p = 0; p < found.pixels(); ++p) {
      const auto bins = valuesOf(found, p, "Z");
      const std::vector<Expected> expected = expectedBins(samples, p, bins);
      Real passed = 1;
      for (size_t b = 0; b < bins.size(); ++b) {
        const size_t at = found.offsets[p] + b;
        const Expected& bin = expected[b];
        const auto value = [&](const char* name) { return Real(found.get(name)[at]); };
        const auto put = [&](Worst& worst, Real is, Real shouldBe, Real scale) {
          worst.put(frame.name, frame.seed, p, is, shouldBe, scale);
        };
        ASSERT_EQ(value("samples"), Real(bin.count)) << frame.name << ", seed " << frame.seed << ", pixel " << p;
        const Real a = value("A");
        put(alpha, passed * a, Real(bin.count) / Real(rays[p]), 1);
        passed *= 1 - a;
        put(mean, value("G"), bin.mean * a, bin.mean * a + FLT_MIN);
        put(variance, value("variance.G"), std::min(bin.variance, Real(1e15)), bin.largest * bin.largest + FLT_MIN);
        const Real n0 = value("half0.samples"), n1 = value("half1.samples");
        EXPECT_EQ(n0 + n1, Real(bin.count));
        if (bin.count > 0)
          put(halves, (n0 * value("half0.G") + n1 * value("half1.G")) / (n0 + n1), bin.mean * a,
              bin.mean * a + FLT_MIN);
      }
    }
  });
}

TEST(StressCluster, OfAnySamplesKeepsAlphaAndFiniteness) {
  Worst alpha("cluster: alpha of any samples", 0x1.1p-23);
  forEachFrame([&](const Frame& frame) {
    DeepImage image = frame.image.copy();
    poison(image, 0.05 * (frame.seed % 3), frame.seed);
    const DeepImage found = deep::cluster(image, deep::findBins(image, 700));
    alpha.touch(frame.name);
    for (const deep::Channel& channel : found.channels)
      for (const float value : channel.values)
        ASSERT_TRUE(std::isfinite(value)) << channel.name << " of " << frame.name << ", seed " << frame.seed;
    for (size_t p = 0; p < found.pixels(); ++p) {
      Real wanted = 0, depth = 0;
      for (const Medium& medium : mediaOf(image, p)) wanted += medium.depth;
      for (const float a : valuesOf(found, p, "A")) depth -= std::log1p(-Real(a));
      alpha.put(frame.name, frame.seed, p, -std::expm1(-depth), -std::expm1(-wanted));
    }
  });
}

TEST(StressCompare, OfBinsInLongDouble) {
  // Sums in double; of two colours that differ by a float's step, 2^-24, the difference is known to 2^-53 / 2^-24.
  Worst worst("compare: bins", 0x1p-27), own("compare: bins, own error", 1e-12);
  forEachFrame([&](const Frame& frame) {
    DeepImage reference = deep::tidy(frame.image.copy()).image, image = reference.copy();
    std::mt19937 random(frame.seed);
    for (float& value : image.get("G")) value *= 0.5f + float(random() % 100) / 100;
    for (const char* name : {"variance.R", "variance.G", "variance.B"})
      for (float& value : reference.add(name, deep::PixelType::Float).values)
        value = random() % 2 ? 0 : 1e9f * float(random() % 10);
    worst.touch(frame.name), own.touch(frame.name);
    Real weight = 0, squared = 0, relative = 0, ownRelative = 0;
    const Buffer<float> weights = deep::effectiveAlpha(reference);  // tested on its own
    for (size_t p = 0; p < reference.pixels(); ++p)
      for (size_t s = reference.offsets[p]; s < reference.offsets[p + 1]; ++s) {
        const Real share = weights[s], a = reference.get("A")[s];
        if (!(share > 0)) continue;
        weight += share;
        for (const char* name : {"R", "G", "B"}) {
          const Real y = Real(reference.get(name)[s]) / a, error = Real(image.get(name)[s]) / a - y;
          squared += share * error * error;
          relative += share * error * error / (y * y + 0.01L);
          ownRelative += share * Real(reference.get(std::string("variance.") + name)[s]) / (y * y + 0.01L);
        }
      }
    if (weight == 0) return;
    const deep::DeepMetrics found = deep::compare(image, reference);
    worst.put(frame.name, frame.seed, 0, found.bins.mse, squared / (3 * weight), squared / (3 * weight) + FLT_MIN);
    worst.put(frame.name, frame.seed, 1, found.bins.relMse, relative / (3 * weight), relative / (3 * weight) + FLT_MIN);
    own.put(frame.name, frame.seed, 0, *found.bins.ownRelMse, ownRelative / (3 * weight),
            ownRelative / (3 * weight) + FLT_MIN);
    EXPECT_EQ(deep::compare(reference, reference).bins.mse, 0);
  });
}

}  // namespace
}  // namespace fathom::stress
