#include "flat/noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "tests/reference/noisy_flat.h"

namespace fathom::flat {
namespace {

using reference::makeNoisyFlat;

void drop(Image& image, const std::string& start) {
  std::erase_if(image.planes, [&](const Plane& plane) { return plane.name.starts_with(start); });
}

TEST(Noise, IsTheFilesVarianceWhereItIsThere) {
  const Image image = makeNoisyFlat(7, 5, 1, 0.5f).noisy;
  const Noise noise = noiseOf(image);
  for (size_t i = 0; i < 35; ++i) {
    EXPECT_FLOAT_EQ(noise.variance[0][i], 0.25f);
    EXPECT_FLOAT_EQ(noise.variance[1][i], 0.16f);
    EXPECT_EQ(noise.samples[i], 16);
    EXPECT_EQ(noise.pixel[i], PixelNoise::Known);
  }
}

TEST(Noise, OfHalvesAgreesWithTheTruthOnAverage) {
  for (const auto& [n0, n1] : {std::pair(8, 8), std::pair(3, 13)})
    for (const bool whole : {true, false}) {
      Image image = makeNoisyFlat(100, 100, 1, 0.5f, n0, n1).noisy;
      drop(image, "variance.");
      if (!whole)
        for (const std::string half : {"half0.", "half1."})
          for (const char* c : kRgbNames)
            std::erase_if(image.planes, [&](const Plane& p) { return p.name == half + c; });
      const Noise noise = noiseOf(image);
      double sum = 0;
      for (const float v : noise.variance[0]) sum += double(v);
      // Squares of normal values: the mean of 10,000 is within 6 % but once in 10,000 times.
      EXPECT_NEAR(sum / 1e4, 0.25, 0.25 * 0.06) << n0 << " and " << n1;
    }
}

TEST(Noise, WithoutAnyIsAnErrorByName) {
  Image image = makeNoisyFlat(3, 3, 1).noisy;
  drop(image, "variance.");
  drop(image, "half1.");
  EXPECT_THROW(noiseOf(image), Error);
  drop(image, "R");
  EXPECT_THROW(noiseOf(image), Error);
}

TEST(Noise, KnowsConvergedAndUnknownPixels) {
  Image image = makeNoisyFlat(9, 9, 1).noisy;
  image.add("samples", 16);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto still = [&](size_t i) {
    for (const char* c : kRgbNames) image.find(std::string("variance.") + c)->values[i] = 0;
  };
  const auto black = [&](size_t i) {
    for (const char* c : kRgbNames) image.find(c)->values[i] = 0;
  };
  still(0);   // lit and without noise
  still(40);  // black beside others
  black(40);
  still(2);  // one camera sample
  image.find("samples")->values[2] = 1;
  image.find("R")->values[3] = nan;
  image.find("variance.G")->values[4] = nan;
  image.find("variance.B")->values[5] = -1;
  image.find("variance.R")->values[6] = 0;  // the other channels have noise
  const Noise noise = noiseOf(image);
  const auto Known = PixelNoise::Known, Converged = PixelNoise::Converged, Unknown = PixelNoise::Unknown;
  EXPECT_EQ(noise.pixel[0], Converged);
  EXPECT_EQ(noise.pixel[40], Known);
  for (const size_t i : {2u, 3u, 4u, 5u}) EXPECT_EQ(noise.pixel[i], Unknown) << i;
  EXPECT_EQ(noise.pixel[6], Known);
  EXPECT_EQ(noise.pixel[7], Known);
  for (const auto& plane : noise.variance)
    for (const float v : plane) EXPECT_TRUE(v >= 0 && v < 1);
  image.find("samples")->values[2] = 4;
  EXPECT_EQ(noiseOf(image).pixel[2], Converged);
  // Black all around is converged.
  for (int y = 2; y <= 6; ++y)
    for (int x = 2; x <= 6; ++x) {
      still(size_t(9 * y + x));
      black(size_t(9 * y + x));
    }
  EXPECT_EQ(noiseOf(image).pixel[40], Converged);
  EXPECT_EQ(noiseOf(image).pixel[39], Known);
  for (const char* c : kRgbNames) image.find(c)->values[42] = 1;  // two pixels to the right
  EXPECT_EQ(noiseOf(image).pixel[40], Known);
}

// The two-buffer variance of each pixel's own counts. Where one half has no samples, nobody knows; where both have none there
// is no noise.
TEST(Noise, HalvesCountByTheirSamples) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float counts[][2] = {{8, 8}, {3, 13}, {1, 1e6f}, {0, 16}, {16, 0}, {0, 0}, {-1, 5}, {nan, 4}};
  Image image{{0, 0, 8, 1}, {0, 0, 8, 1}, {}, {}};
  for (const char* c : kRgbNames) {
    image.add(c, 0.5f);
    image.add(std::string("half0.") + c, 0.9f);
    image.add(std::string("half1.") + c, 0.2f);
  }
  image.add("half0.samples");
  image.add("half1.samples");
  for (size_t i = 0; i < 8; ++i) {
    image.find("half0.samples")->values[i] = counts[i][0];
    image.find("half1.samples")->values[i] = counts[i][1];
  }
  const Noise noise = noiseOf(image);
  for (size_t i = 0; i < 8; ++i) {
    const double m = double(counts[i][0]), n = double(counts[i][1]);
    const double expected = m > 0 && n > 0 ? m * n / (m + n) / (m + n) * 0.7 * 0.7 : 0;
    EXPECT_NEAR(noise.variance[2][i], expected, 1e-6 * expected) << i;
    EXPECT_EQ(noise.pixel[i], i < 3 ? PixelNoise::Known : i == 5 ? PixelNoise::Converged : PixelNoise::Unknown) << i;
  }
}

// `samples` before fathom:spp; less than one sample, or no number, is one.
TEST(Noise, SamplesAreWhatTheFileTells) {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  Image image{{0, 0, 6, 1}, {0, 0, 6, 1}, {}, {}};
  for (const char* c : kRgbNames) {
    image.add(c, 1);
    image.add(std::string("variance.") + c, 0.1f);
  }
  for (const float n : noiseOf(image).samples) EXPECT_EQ(n, 1);
  image.attributes["fathom:spp"] = "32";
  for (const float n : noiseOf(image).samples) EXPECT_EQ(n, 32);
  const float counts[] = {7, 1.5f, 0.5f, -3, inf, nan}, expected[] = {7, 1.5f, 1, 1, 1, 1};
  Buffer<float>& samples = image.add("samples").values;
  std::copy_n(counts, 6, samples.begin());
  const Noise noise = noiseOf(image);
  for (size_t i = 0; i < 6; ++i) EXPECT_EQ(noise.samples[i], expected[i]) << i;
}

// No variance from how many samples: known to be none where nothing tells, or from four.
TEST(Noise, StillIsConvergedFromFourSamples) {
  Image image{{0, 0, 6, 1}, {0, 0, 6, 1}, {}, {}};
  for (const char* c : kRgbNames) {
    image.add(c, 1);
    image.add(std::string("variance.") + c);
  }
  const auto pixel = [&](size_t i) { return noiseOf(image).pixel[i]; };
  EXPECT_EQ(pixel(0), PixelNoise::Converged);
  image.attributes["fathom:spp"] = "3";
  EXPECT_EQ(pixel(0), PixelNoise::Unknown);
  image.attributes["fathom:spp"] = "4";
  EXPECT_EQ(pixel(0), PixelNoise::Converged);
  image.add("samples", std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(pixel(0), PixelNoise::Unknown);
}

TEST(Noise, LevelIsTheMeanOfFiniteColours) {
  Image image{{0, 0, 2, 1}, {0, 0, 2, 1}, {}, {}};
  for (const char* c : kRgbNames) {
    image.add(c, 3);
    image.add(std::string("variance.") + c, 1);
  }
  image.find("G")->values[1] = std::numeric_limits<float>::infinity();
  EXPECT_FLOAT_EQ(noiseOf(image).level, 3);
  for (const char* c : kRgbNames) image.find(c)->values.fill(0);
  EXPECT_FLOAT_EQ(noiseOf(image).level, 0.5f);
}

}  // namespace
}  // namespace fathom::flat
