// Steps along the noise: their moments, and that the parts of a render stay consistent.
#include "flat/perturb.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/reference/noisy_flat.h"

namespace fathom::flat {
namespace {

using reference::makeNoisyFlat;

constexpr float kSize = 0.5f;

double at(const Image& image, const std::string& name, size_t i) {
  return double(image.get(name).values[i]);
}

TEST(Perturb, MovesTheMeanByItsStandardDeviationAndAllChannelsTogether) {
  const Image noisy = makeNoisyFlat(21, 13, 1).noisy;
  const Noise noise = noiseOf(noisy);
  const Image moved = Perturber(noisy, noise).moved(1, 0, kSize);
  int up = 0;
  for (size_t i = 0; i < noisy.dataWindow.area(); ++i) {
    const double step = at(moved, "R", i) - at(noisy, "R", i);
    EXPECT_NEAR(std::abs(step), 0.5 * 0.1, 1e-6);
    EXPECT_NEAR((at(moved, "G", i) - at(noisy, "G", i)) / 0.8, step, 1e-6);
    up += step > 0;
  }
  EXPECT_NEAR(up, 136, 35);  // of 273, four standard deviations
}

TEST(Perturb, KeepsMeansOfHalvesAndSumsOfComponents) {
  for (const auto& [n0, n1] : {std::pair(8, 8), std::pair(3, 13), std::pair(1, 15)}) {
    Image noisy = makeNoisyFlat(21, 13, 1, 0.1f, n0, n1).noisy;
    for (size_t i = 0; i < noisy.dataWindow.area(); i += 2) {
      noisy.find("half0.diffuse.R")->values[i] += 0.3f;  // unequal parts
      noisy.find("half0.R")->values[i] += 0.3f;
    }
    const Noise noise = noiseOf(noisy);
    const Image moved = Perturber(noisy, noise).moved(7, 3, kSize);
    const auto step = [&](const std::string& name, size_t i) { return at(moved, name, i) - at(noisy, name, i); };
    for (size_t i = 0; i < noisy.dataWindow.area(); ++i)
      for (const std::string c : {"R", "G", "B"}) {
        EXPECT_NEAR(step(c, i), (n0 * step("half0." + c, i) + n1 * step("half1." + c, i)) / (n0 + n1), 1e-6);
        for (const std::string half : {"", "half0.", "half1."})
          EXPECT_NEAR(step(half + c, i),
                      step(fmt::format("{}diffuse.{}", half, c), i) + step(fmt::format("{}specular.{}", half, c), i),
                      1e-6);
      }
  }
}

TEST(Perturb, HalvesHaveTheirVarianceAndAreUncorrelated) {
  const int n0 = 3, n1 = 13;
  const Image noisy = makeNoisyFlat(100, 100, 1, 0.1f, n0, n1).noisy;
  const Noise noise = noiseOf(noisy);
  const Image moved = Perturber(noisy, noise).moved(1, 0, 1);
  double v0 = 0, v1 = 0, both = 0;
  for (size_t i = 0; i < 10000; ++i) {
    const double a = at(moved, "half0.R", i) - at(noisy, "half0.R", i),
                 b = at(moved, "half1.R", i) - at(noisy, "half1.R", i);
    v0 += a * a / 1e4;
    v1 += b * b / 1e4;
    both += a * b / 1e4;
  }
  EXPECT_NEAR(v0, 0.01 * 16 / n0, 0.01 * 16 / n0 * 0.05);
  EXPECT_NEAR(v1, 0.01 * 16 / n1, 0.01 * 16 / n1 * 0.05);
  EXPECT_NEAR(both, 0, 0.05 * std::sqrt(v0 * v1));
}

TEST(Perturb, SharesTheStepByVariance) {
  Image noisy = makeNoisyFlat(9, 9, 1).noisy;
  for (const char* c : kRgbNames) {
    noisy.add(std::string("variance.diffuse.") + c, 3e-3f);
    noisy.add(std::string("variance.specular.") + c, 1e-3f);
  }
  const Noise noise = noiseOf(noisy);
  const Image moved = Perturber(noisy, noise).moved(1, 0, 1);
  for (size_t i = 0; i < 81; ++i)
    EXPECT_NEAR(at(moved, "diffuse.G", i) - at(noisy, "diffuse.G", i), 0.75 * (at(moved, "G", i) - at(noisy, "G", i)),
                1e-6);
}

TEST(Perturb, AlbedoMovesWithTheColourAsFarAsItsHalvesDo) {
  Image noisy = makeNoisyFlat(15, 11, 1).noisy;
  const size_t pixels = noisy.dataWindow.area();
  for (const char* c : kRgbNames) {
    noisy.add(std::string("albedo.") + c, 0.5f);
    noisy.add(std::string("variance.albedo.") + c, 4e-4f);
    const std::string name = std::string("albedo.") + c;
    for (const std::string half : {"half0.", "half1."}) {
      Buffer<float>& values = noisy.add(half + name).values;
      const Buffer<float>& colour = noisy.get(half + c).values;
      // R: with the colour, G: against it, B: not at all.
      const float slope = *c == 'R' ? 0.2f : *c == 'G' ? -0.2f : 0;
      for (size_t i = 0; i < pixels; ++i) values[i] = 0.5f + slope * (colour[i] - noisy.get(c).values[i]);
    }
  }
  const Noise noise = noiseOf(noisy);
  const Image moved = Perturber(noisy, noise).moved(1, 0, 1);
  for (size_t i = 0; i < pixels; ++i) {
    const double sign = at(moved, "R", i) > at(noisy, "R", i) ? 1 : -1;
    EXPECT_NEAR(at(moved, "albedo.R", i) - 0.5, sign * 0.02, 1e-4);
    EXPECT_NEAR(at(moved, "albedo.G", i) - 0.5, -sign * 0.02, 1e-4);
    EXPECT_EQ(at(moved, "albedo.B", i), 0.5);
  }
}

TEST(Perturb, IsTheSameForAnyWindowAndDiffersBetweenProbes) {
  const Image whole = makeNoisyFlat(21, 13, 1).noisy;
  Image part{{2, 6, 9, 11}, whole.displayWindow, {}, {}};
  for (const Plane& plane : whole.planes) {
    Buffer<float>& values = part.add(plane.name).values;
    for (int y = part.dataWindow.y0; y < part.dataWindow.y1; ++y)
      for (int x = part.dataWindow.x0; x < part.dataWindow.x1; ++x)
        values[part.dataWindow.index(x, y)] = plane.values[whole.dataWindow.index(x, y)];
  }
  const Noise noise = noiseOf(whole), ofPart = noiseOf(part);
  const Image a = Perturber(whole, noise).moved(1, 0, kSize), b = Perturber(part, ofPart).moved(1, 0, kSize),
              other = Perturber(whole, noise).moved(1, 1, kSize), seed = Perturber(whole, noise).moved(2, 0, kSize);
  int alike = 0, alikeSeed = 0;
  for (int y = part.dataWindow.y0; y < part.dataWindow.y1; ++y)
    for (int x = part.dataWindow.x0; x < part.dataWindow.x1; ++x) {
      const size_t i = whole.dataWindow.index(x, y);
      for (const char* name : {"R", "half0.B"})
        EXPECT_EQ(a.get(name).values[i], b.get(name).values[part.dataWindow.index(x, y)]);
      alike += a.get("R").values[i] == other.get("R").values[i];
      alikeSeed += a.get("R").values[i] == seed.get("R").values[i];
    }
  EXPECT_NEAR(alike, 17, 13);  // of 35
  EXPECT_NEAR(alikeSeed, 17, 13);
}

}  // namespace
}  // namespace fathom::flat
