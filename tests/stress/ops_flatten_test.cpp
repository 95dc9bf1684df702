// Compositing at the ends of the numbers: flatten, and what tells of single samples, against one pixel in long double.
#include <gtest/gtest.h>

#include <cfloat>

#include "deep/alpha.h"
#include "deep/flatten.h"
#include "deep/ops/sample.h"
#include "deep/tidy.h"
#include "tests/reference/transmittance.h"
#include "tests/stress/exact_pixel.h"
#include "tests/stress/extreme_deep.h"
#include "tests/stress/frames.h"
#include "tests/stress/worst.h"

namespace fathom::stress {
namespace {

using deep::DeepImage;

// Sums are in double and then rounded to a float: half a step of it is 2^-24, and sums of 1,000 terms are far from that.
constexpr double kRounded = 0x1.01p-24;

TEST(StressFlatten, ColourAndAlpha) {
  Worst colour("flatten: colour", kRounded), alpha("flatten: alpha", kRounded);
  forEachFrame([&](const Frame& frame) {
    const flat::Image flat = deep::flatten(frame.image);
    colour.touch(frame.name), alpha.touch(frame.name);
    for (size_t p = 0; p < frame.image.pixels(); ++p) {
      const ExactPixel exact = exactPixel(frame.image, p);
      for (const char* name : {"R", "G", "B"}) {
        const auto values = valuesOf(frame.image, p, name);
        colour.put(frame.name, frame.seed, p, flat.get(name).values[p], exact.light(values, kForever, true),
                   magnitude(values));
      }
      alpha.put(frame.name, frame.seed, p, flat.get("A").values[p], exact.alphaOfAll(), exact.alphaOfAll() + FLT_MIN);
    }
  });
}

// Whose points at one depth are composited one after the other.
TEST(StressFlatten, CameraSamples) {
  Worst colour("flatten: colour, camera samples", kRounded);
  forEachFrame([&](const Frame& frame) {
    DeepImage image = frame.image.copy();
    image.attributes.set("fathom:spp", 16);
    const flat::Image flat = deep::flatten(image);
    colour.touch(frame.name);
    for (size_t p = 0; p < image.pixels(); ++p) {
      const auto values = valuesOf(image, p, "G");
      colour.put(frame.name, frame.seed, p, flat.get("G").values[p], exactPixel(image, p).light(values, kForever, true),
                 magnitude(values));
    }
  });
}

TEST(StressFlatten, DepthsAndPlainChannels) {
  // The mean is a quotient of two sums in double, rounded to a float; so are plain means.
  Worst mean("flatten: Z", 0x1.01p-24), plain("flatten: coc", 0x1.01p-24);
  forEachFrame([&](const Frame& frame) {
    const flat::Image flat = deep::flatten(
        frame.image, {.depths = {deep::FlatDepth::Front, deep::FlatDepth::Back, deep::FlatDepth::Transmittance}});
    mean.touch(frame.name), plain.touch(frame.name);
    for (size_t p = 0; p < frame.image.pixels(); ++p) {
      const ExactPixel exact = exactPixel(frame.image, p);
      const std::vector<Real> seen = exact.seen();
      const auto coc = valuesOf(frame.image, p, "coc");
      Real all = 0, sum = 0, front = kForever, nearest = kForever, farthest = 0;
      for (size_t i = 0; i < seen.size(); ++i) {
        nearest = std::min(nearest, exact.media()[i].z);
        if (std::isfinite(exact.media()[i].z)) farthest = std::max(farthest, exact.media()[i].zBack);
        if (seen[i] > 0) front = std::min(front, exact.media()[i].z);
        all += seen[i], sum += seen[i] * coc[i];
      }
      const auto where = [&] {
        return ::testing::Message() << frame.name << ", seed " << frame.seed << ", pixel " << p;
      };
      if (all > 0) plain.put(frame.name, frame.seed, p, flat.get("coc").values[p], sum / all, sum / all);
      if (const auto depth = exact.meanDepth()) {
        // What is behind the nearly opaque is seen by some 2^-53 more or less, however far it is.
        mean.put(frame.name, frame.seed, p, flat.get("Z").values[p], *depth, *depth + 1e-8L * farthest);
        EXPECT_EQ(flat.get("Z.front").values[p], float(front)) << where();
        EXPECT_GE(flat.get("Z.back").values[p], float(front)) << where();
        const float half = flat.get("Z.transmittance").values[p];
        const bool reached = exact.passing(std::nextafter(half, kInfinity)) <= 0.5L + 1e-6L;
        EXPECT_GE(exact.passing(half) + 1e-6L, std::min(0.5L, exact.passing())) << where();
        EXPECT_TRUE(reached || half == flat.get("Z.back").values[p]) << where();
      } else if (!seen.empty()) {
        EXPECT_EQ(flat.get("Z").values[p], float(nearest)) << where();
      }
    }
  });
}

TEST(StressSample, LightAndTransmittance) {
  // Both in double: alphas are rounded only where volumes overlap, in doubles.
  Worst seen("sample: seen", 1e-13), front("sample: in front", 1e-13), passing("sample: transmittance", 1e-13);
  forEachFrame([&](const Frame& frame) {
    const Box& window = frame.image.dataWindow;
    seen.touch(frame.name), front.touch(frame.name), passing.touch(frame.name);
    for (size_t p = 0; p < frame.image.pixels(); ++p) {
      const int x = window.x0 + int(p) % window.width(), y = window.y0 + int(p) / window.width();
      const ExactPixel exact = exactPixel(frame.image, p);
      const std::vector<Real> alphas = exact.seen();
      const std::vector<deep::SampleLight> light = deep::lightOf(frame.image, x, y);
      std::vector<float> depths;
      for (size_t i = 0; i < light.size(); ++i) {
        const Medium& medium = exact.media()[i];
        seen.put(frame.name, frame.seed, p, light[i].seen, alphas[i]);
        front.put(frame.name, frame.seed, p, light[i].front,
                  medium.isPoint() ? exact.passing(medium.z) : exact.passingPoints(medium.z));
        depths.insert(depths.end(), {float(medium.z), float(medium.zBack), float(medium.z / 2 + medium.zBack / 2)});
      }
      std::sort(depths.begin(), depths.end());
      const std::vector<double> found = deep::passingTo(frame.image, x, y, depths);
      for (size_t i = 0; i < depths.size(); ++i)
        passing.put(frame.name, frame.seed, p, found[i], exact.passing(depths[i]));
    }
  });
}

TEST(StressEffectiveAlpha, OfTidyFrames) {
  Worst seen("effective alpha", 0x1.01p-24);
  forEachFrame([&](const Frame& frame) {
    const DeepImage image = deep::tidy(frame.image.copy()).image;
    const Buffer<float> found = deep::effectiveAlpha(image);
    seen.touch(frame.name);
    for (size_t p = 0; p < image.pixels(); ++p) {
      const std::vector<Real> expected = exactPixel(image, p).seen();
      for (size_t i = 0; i < expected.size(); ++i)
        seen.put(frame.name, frame.seed, p, found[image.offsets[p] + i], expected[i], expected[i] + FLT_MIN);
    }
  });
}

}  // namespace
}  // namespace fathom::stress
