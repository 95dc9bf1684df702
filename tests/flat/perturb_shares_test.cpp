// How a step along the noise is shared among components, halves and the albedo, by hand.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "flat/perturb.h"

namespace fathom::flat {
namespace {

double at(const Image& image, const std::string& name, size_t i) {
  return double(image.get(name).values[i]);
}

// A frame of one colour with its noise and nothing else; what a test adds tells the shares.
Image plainFrame(int width, int height, float noise = 0.1f) {
  Image image{{3, 4, 3 + width, 4 + height}, {0, 0, 9, 9}, {}, {}};
  for (const char* c : kRgbNames) {
    image.add(c, 0.5f);
    image.add(std::string("variance.") + c, noise * noise);
  }
  return image;
}

// How far a plane moves in a pixel while the colour moves by 1; the step is the deviation.
double partOf(const Image& noisy, const Image& moved, const std::string& name, const char* colour, size_t i) {
  return (at(moved, name, i) - at(noisy, name, i)) / (at(moved, colour, i) - at(noisy, colour, i));
}

TEST(Perturb, SharesTheStepByLightWithoutVariances) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const float lights[][3] = {{0.3f, 0.1f, 0.75f}, {0, 0.2f, 0},         {0.2f, 0, 1},
                             {0, 0, 0.5f},        {-0.3f, 0.1f, 0.75f}, {0.1f, -0.3f, 0.25f},
                             {nan, 0.1f, 0},      {0.1f, inf, 1},       {nan, nan, 0.5f}};
  Image noisy = plainFrame(9, 1);
  for (const char* c : kRgbNames)
    for (size_t k = 0; k < 2; ++k) {
      Buffer<float>& values = noisy.add(std::string(k ? "specular." : "diffuse.") + c).values;
      for (size_t i = 0; i < 9; ++i) values[i] = lights[i][k];
    }
  const Noise noise = noiseOf(noisy);
  const Image moved = Perturber(noisy, noise).moved(1, 0, 1);
  for (size_t i = 0; i < 9; ++i)
    for (size_t k = 0; k < 2; ++k) {
      if (!std::isfinite(lights[i][k])) continue;
      EXPECT_NEAR(partOf(noisy, moved, k ? "specular.G" : "diffuse.G", "G", i),
                  double(k ? 1 - lights[i][2] : lights[i][2]), 1e-6)
          << i;
    }
}

// Variances told for both components, for one beside the other's halves, and by halves alone: of 5x5 pixels, what is no
// variance as nothing.
TEST(Perturb, SharesAreOfVariancesAround) {
  const int width = 9, height = 7;
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const bool diffuseTold : {false, true})
    for (const bool specularTold : {false, true}) {
      Image noisy = plainFrame(width, height);
      std::array<std::vector<double>, 2> variance;
      for (size_t k = 0; k < 2; ++k) {
        const std::string group = k ? "specular." : "diffuse.";
        for (const char* c : kRgbNames) {
          variance[k].clear();
          noisy.add(group + c, 0.25f);
          noisy.add("half0." + group + c);
          noisy.add("half1." + group + c);
          if (k ? specularTold : diffuseTold) noisy.add("variance." + group + c);
          Buffer<float>&a = noisy.find("half0." + group + c)->values, &b = noisy.find("half1." + group + c)->values;
          Plane* const plane = noisy.find("variance." + group + c);
          Buffer<float>* told = plane ? &plane->values : nullptr;
          for (size_t i = 0; i < a.size(); ++i) {
            a[i] = 0.25f + 0.01f * float((7 * i + 3 * k) % 11);
            b[i] = 0.25f - 0.01f * float((5 * i + k) % 7);
            if (i == 20) a[i] = k ? nan : inf;
            const double d = i == 20 ? 0 : 0.5 * (double(a[i]) - double(b[i]));
            variance[k].push_back(d * d);
            if (!told) continue;
            (*told)[i] = 1e-3f * float((3 * i + k) % 13);
            variance[k].back() = double((*told)[i]);
            if (i % 17 == 5) (*told)[i] = i == 5 ? -1 : i == 22 ? nan : inf, variance[k].back() = 0;
          }
        }
      }
      const Noise noise = noiseOf(noisy);
      const Image moved = Perturber(noisy, noise).moved(1, 0, 1);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
          std::array<double, 2> sum{};
          for (int yq = std::max(0, y - 2); yq <= std::min(height - 1, y + 2); ++yq)
            for (int xq = std::max(0, x - 2); xq <= std::min(width - 1, x + 2); ++xq)
              for (size_t k = 0; k < 2; ++k) sum[k] += variance[k][size_t(yq * width + xq)];
          EXPECT_NEAR(partOf(noisy, moved, "diffuse.G", "G", size_t(y * width + x)), sum[0] / (sum[0] + sum[1]), 1e-5)
              << x << " " << y << ", told " << diffuseTold << specularTold;
        }
    }
}

// Only one component has noise.
TEST(Perturb, AComponentWithoutNoiseStays) {
  for (const bool diffuse : {false, true}) {
    Image noisy = plainFrame(3, 3);
    for (const char* c : kRgbNames) {
      noisy.add(std::string("diffuse.") + c, 0.4f);
      noisy.add(std::string("specular.") + c, 0.1f);
      noisy.add(std::string(diffuse ? "variance.diffuse." : "variance.specular.") + c, 0.01f);
    }
    const Noise noise = noiseOf(noisy);
    const Image moved = Perturber(noisy, noise).moved(1, 0, 1);
    for (size_t i = 0; i < 9; ++i) EXPECT_NEAR(partOf(noisy, moved, "diffuse.B", "B", i), diffuse ? 1 : 0, 1e-6);
  }
}

// Halves of components whose means are not there: nothing tells which has the noise, so both move by half.
TEST(Perturb, ComponentsOfHalvesAloneAddUp) {
  Image noisy = plainFrame(5, 4);
  for (const char* half : {"half0.", "half1."})
    for (const char* group : {"", "diffuse.", "specular."})
      for (const char* c : kRgbNames) noisy.add(fmt::format("{}{}{}", half, group, c), 0.2f);
  const Noise noise = noiseOf(noisy);
  const Image moved = Perturber(noisy, noise).moved(1, 0, 1);
  for (size_t i = 0; i < 20; ++i)
    for (const std::string half : {"half0.", "half1."}) {
      const auto step = [&](const std::string& name) { return at(moved, half + name, i) - at(noisy, half + name, i); };
      EXPECT_NEAR(step("diffuse.R"), step("R") / 2, 1e-6) << i;
      EXPECT_NEAR(step("specular.R"), step("R") / 2, 1e-6) << i;
    }
}

// Counts of each pixel: a half without samples stays, and its sign does not reach the other.
TEST(Perturb, HalvesWithoutSamplesStay) {
  const float counts[][2] = {{3, 13}, {0, 16}, {16, 0}, {0, 0}, {16, -1}, {4, 4}};
  Image noisy = plainFrame(6, 1);
  for (int h = 0; h < 2; ++h) {
    for (const char* c : kRgbNames) noisy.add(fmt::format("half{}.{}", h, c), 0.5f);
    Buffer<float>& samples = noisy.add(fmt::format("half{}.samples", h)).values;
    for (size_t i = 0; i < 6; ++i) samples[i] = counts[i][h];
  }
  const Noise noise = noiseOf(noisy);
  const Image moved = Perturber(noisy, noise).moved(1, 0, 1);
  for (size_t i = 0; i < 6; ++i)
    for (const size_t h : {0U, 1U}) {
      const double part = partOf(noisy, moved, h ? "half1.R" : "half0.R", "R", i), own = double(counts[i][h]),
                   other = std::max(0.0, double(counts[i][1 - h]));
      if (own <= 0)
        EXPECT_EQ(part, 0) << i;
      else
        EXPECT_NEAR(std::abs(part - 1), std::sqrt(other / own), 1e-5) << i;
    }
}

// Halves of an albedo that differ as those of the colour, times `slope`.
Image withAlbedo(int width, int height, float noise, float slope, bool components) {
  Image noisy = plainFrame(width, height, noise);
  for (const char* c : kRgbNames) {
    noisy.find(c)->values.fill(5 * noise);
    noisy.add(std::string("albedo.") + c);
    for (int h = 0; h < 2; ++h) {
      Buffer<float> colour(noisy.dataWindow.area()), albedo(noisy.dataWindow.area());
      for (size_t i = 0; i < colour.size(); ++i) {
        const float step = float((7 * i + 2) % 5) - 1.7f;
        colour[i] = (h ? -noise : noise) * step;
        albedo[i] = slope * colour[i] / noise;
      }
      noisy.add(fmt::format("half{}.albedo.{}", h, c)).values = std::move(albedo);
      if (components)
        for (const char* group : {"diffuse.", "specular."}) {
          Buffer<float>& part = noisy.add(fmt::format("half{}.{}{}", h, group, c)).values;
          for (size_t i = 0; i < colour.size(); ++i) part[i] = (*group == 'd' ? 0.25f : 0.75f) * colour[i];
        }
      else
        noisy.add(fmt::format("half{}.{}", h, c)).values = std::move(colour);
    }
  }
  return noisy;
}

double albedoStep(const Image& noisy, size_t i) {
  const Noise noise = noiseOf(noisy);
  const Image moved = Perturber(noisy, noise).moved(1, 0, 1);
  const double step = at(moved, "albedo.G", i) - at(noisy, "albedo.G", i);
  return at(moved, "G", i) > at(noisy, "G", i) ? step : -step;
}

// Without a variance its halves tell how far: half their difference, of the pixel itself.
TEST(Perturb, AlbedosHalvesTellHowFarItMoves) {
  for (const bool components : {false, true})
    for (const float slope : {0.2f, -0.2f}) {
      const Image noisy = withAlbedo(7, 5, 0.1f, slope, components);
      for (size_t i = 0; i < 35; ++i) {
        const double half = std::abs(at(noisy, "half0.albedo.G", i) - at(noisy, "half1.albedo.G", i)) / 2;
        EXPECT_NEAR(albedoStep(noisy, i), slope > 0 ? half : -half, 1e-6) << i;
      }
    }
}

// A plane of the whole is what differs where there are components beside it.
TEST(Perturb, TheWholesHalvesComeBeforeTheirComponents) {
  Image noisy = withAlbedo(7, 5, 0.1f, 0.2f, false);
  for (const char* c : kRgbNames)
    for (int h = 0; h < 2; ++h)
      for (const char* group : {"diffuse.", "specular."}) {
        Buffer<float>& part = noisy.add(fmt::format("half{}.{}{}", h, group, c)).values;
        for (size_t i = 0; i < part.size(); ++i) part[i] = -noisy.get(fmt::format("half{}.{}", h, c)).values[i];
      }
  for (size_t i = 0; i < 35; ++i) EXPECT_GT(albedoStep(noisy, i), 1e-3) << i;
}

TEST(Perturb, DimLightMovesItsAlbedoAsMuch) {
  const Image noisy = withAlbedo(7, 5, 1e-18f, 1e-7f, false);
  for (size_t i = 0; i < 35; ++i) {
    const double half = std::abs(at(noisy, "half0.albedo.G", i) - at(noisy, "half1.albedo.G", i)) / 2;
    EXPECT_NEAR(albedoStep(noisy, i), half, 1e-3 * half) << i;
  }
}

TEST(Perturb, OddHalvesSayNothingButOfTheirPixel) {
  Image noisy = withAlbedo(7, 5, 0.1f, 0.2f, false), clean = noisy.copy();
  noisy.find("half0.G")->values[17] = std::numeric_limits<float>::infinity();
  for (size_t i = 0; i < 35; ++i) {
    if (i == 17) continue;
    EXPECT_NEAR(albedoStep(noisy, i) / albedoStep(clean, i), 1, 0.05) << i;  // its albedo still differs
  }
}

// Where the colour has none, its albedo does not move either: with alike halves, and where the colour is known.
TEST(Perturb, WithoutNoiseNothingMoves) {
  Image noisy = withAlbedo(7, 5, 0.1f, 0.2f, false), alike = noisy.copy();
  for (const char* c : kRgbNames) {
    noisy.find(std::string("variance.") + c)->values[17] = 0;
    for (int h = 0; h < 2; ++h) alike.find(fmt::format("half{}.{}", h, c))->values.fill(0.5f);
  }
  const Noise noise = noiseOf(noisy);
  const Image moved = Perturber(noisy, noise).moved(1, 0, 1);
  for (const Plane& plane : noisy.planes) EXPECT_EQ(moved.get(plane.name).values[17], plane.values[17]) << plane.name;
  for (size_t i = 0; i < 35; ++i) EXPECT_EQ(albedoStep(alike, i), 0);
}

}  // namespace
}  // namespace fathom::flat
