// Clustering against its twin, the laws of counts, alphas and halves, and samples that are not camera samples.
#include "deep/cluster.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "base/error.h"
#include "deep/alpha.h"
#include "deep/flatten.h"
#include "deep/tidy.h"
#include "tests/reference/cluster.h"
#include "tests/reference/deep_samples.h"

namespace fathom::deep {
namespace {

using reference::CameraSample;
using reference::makeDeep;
using reference::Pixels;
using reference::Sample;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kPpuScale = 300;

template <class Values>
auto listOf(const Values& values) {
  return std::vector(values.begin(), values.end());
}

// The camera samples of a pixel as a renderer writes them: sorted, the k-th of spp with alpha 1 / (spp - k).
std::vector<Sample> asDeepSamples(std::vector<CameraSample> samples, int spp) {
  std::sort(samples.begin(), samples.end(), [](const auto& a, const auto& b) { return a.z < b.z; });
  std::vector<Sample> result;
  for (size_t k = 0; k < samples.size(); ++k) {
    const double alpha = 1.0 / (spp - int(k));
    result.push_back(
        {float(samples[k].z), float(samples[k].z), float(alpha), float(samples[k].value * alpha), uint32_t(k)});
  }
  return result;
}

// Depths in a few groups with gaps of all sizes between and in them.
std::vector<CameraSample> randomCameraSamples(size_t count, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(0, 1);
  std::lognormal_distribution<double> bright(-1, 1);
  std::vector<CameraSample> samples;
  for (size_t i = 0; i < count; ++i) {
    const double group = 1 + std::floor(uniform(random) * 4) * 0.3, spread = std::pow(10, -4 * uniform(random));
    samples.push_back({double(float(group + spread * uniform(random))), bright(random)});
  }
  return samples;
}

DeepImage cameraImage(const std::vector<std::vector<CameraSample>>& pixels, int spp, int width, bool volumes = false) {
  Pixels deep;
  for (const auto& pixel : pixels) deep.push_back(asDeepSamples(pixel, spp));
  DeepImage image = makeDeep(deep, width, volumes);
  image.attributes.set("fathom:spp", spp);
  return image;
}

std::vector<std::vector<CameraSample>> randomPixels(size_t count, int spp, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<size_t> hits(0, size_t(spp));
  std::vector<std::vector<CameraSample>> pixels(count);
  for (auto& pixel : pixels) pixel = randomCameraSamples(hits(random), random);
  return pixels;
}

DeepImage clustered(const DeepImage& samples, const ClusterParams& params = {}) {
  return cluster(samples, findBins(samples, kPpuScale, params));
}

// Volumes, points, emission and opaque samples anywhere, with any alpha.
Pixels randomSamples(size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0, 1);
  Pixels pixels(count);
  for (size_t p = 0; p < count; ++p)
    for (size_t i = 0; i < p % 13; ++i) {
      const float kind = uniform(random), alpha = kind < 0.1f ? 0 : kind < 0.2f ? 1 : uniform(random);
      const float z = 1 + uniform(random) * (kind < 0.5f ? 1.0f : 0.01f);
      pixels[p].push_back({z, z, alpha, uniform(random), uint32_t(i)});
    }
  return pixels;
}

// Alphas as HALF tell thousands of camera samples only roughly; the attribute tells them all.
TEST(Cluster, KnowsItsCameraSamplesByTheAttribute) {
  constexpr int kSpp = 1500;
  const DeepImage exact = cameraImage({std::vector<CameraSample>(kSpp, {2, 0.5})}, kSpp, 1);
  DeepImage image = exact.copy();
  image.find("A")->type = PixelType::Half;
  for (float& alpha : image.get("A")) alpha = alpha * (1 - 0x1p-11f);  // as far off as HALF may be
  const DeepImage bins = cluster(image, findBins(image, kPpuScale, {}));
  ASSERT_EQ(bins.samples(), 1u);
  EXPECT_EQ(bins.get("A")[0], 1) << "all that the camera sent ended there";
}

TEST(BinLayout, AgreesWithTheTwin) {
  std::mt19937 random(1);
  for (const double E : {0.0, 0.5, 1.0, 2.0, 3.0})
    for (const double first : {0.0, 1.0, 2.5})
      for (size_t count = 0; count <= 70; ++count) {
        const std::vector<CameraSample> samples = randomCameraSamples(count, random);
        const DeepImage image = clustered(cameraImage({samples}, 70, 1), {E, first});
        const std::vector<reference::Bin> expected = reference::cluster(samples, double(kPpuScale), E, first);
        ASSERT_EQ(image.samples(), expected.size()) << count << " samples, E " << E << ", first " << first;
        const auto alpha = image.get("A");
        for (size_t b = 0; b < expected.size(); ++b) {
          EXPECT_EQ(image.get("Z")[b], float(expected[b].z));
          EXPECT_EQ(image.get("samples")[b], float(expected[b].count));
          const double mean = expected[b].mean * double(alpha[b]), variance = expected[b].variance;
          EXPECT_NEAR(image.get("R")[b], mean, 1e-6 * mean);
          EXPECT_NEAR(image.get("B")[b], 2 * mean, 2e-6 * mean);
          // Values come from products with alphas, rounded to float.
          const double rounding = 1e-6 * (variance + expected[b].mean * std::sqrt(variance));
          EXPECT_NEAR(image.get("variance.R")[b], variance, rounding + 1e-13);
          EXPECT_NEAR(image.get("variance.Z")[b], expected[b].zVariance, 1e-5 * expected[b].zVariance + 1e-15);
        }
      }
}

TEST(BinLayout, TheGapBeforeASampleDecides) {
  // Figure 10 to the letter splits before the last sample in front of a gap, which then is a bin of its own.
  const std::vector<Sample> samples = {{1, 1}, {1.001f, 1}, {1.002f, 1}, {5, 5}, {5.001f, 5}};
  const BinLayout layout = findBins(makeDeep({samples}, 1), kPpuScale);
  EXPECT_THAT(listOf(layout.depth), ElementsAre(testing::FloatEq(1.001f), testing::FloatEq(5.0005f)));
}

TEST(BinLayout, ThresholdsGrowWithTheBin) {
  // Gaps of 5 pixels each at depth 1: more than (1 + 1)^2, less than (2 + 1)^2.
  const DeepImage image = makeDeep({{{1, 1}, {1.05f, 1}, {1.1f, 1}}}, 1);
  EXPECT_EQ(findBins(image, 100).depth.size(), 2u);
  EXPECT_EQ(findBins(image, 100, {.E = 0}).depth.size(), 3u);
  EXPECT_EQ(findBins(image, 100, {.E = 2, .first = 0}).depth.size(), 3u);
  EXPECT_EQ(findBins(image, 40).depth.size(), 1u);
}

TEST(BinLayout, EndsForEveryDepth) {
  std::vector<Sample> samples;
  for (const float z : {-kInfinity, -1.0f, -0.0f, 0.0f, 1e-45f, 1e-30f, 1.0f, 3e38f, kInfinity, kNan})
    for (int i = 0; i < 3; ++i) samples.push_back({z, z, 0.1f, 0.1f, 1});
  const DeepImage image = clustered(makeDeep({samples}, 1, false));
  float count = 0;
  for (const float n : image.get("samples")) count += n;
  EXPECT_EQ(count, 30);
  for (const char* name : {"R", "A", "Z", "variance.R", "half0.R"})
    for (const float value : image.get(name)) EXPECT_TRUE(std::isfinite(value)) << name;
}

TEST(Cluster, EffectiveAlphasAreCountsOverSpp) {
  for (const int spp : {1, 2, 3, 8, 64, 100, 1000}) {
    const DeepImage image = clustered(cameraImage(randomPixels(200, spp, unsigned(spp)), spp, 20));
    const auto alpha = image.get("A"), count = image.get("samples");
    for (size_t p = 0; p < image.pixels(); ++p) {
      double passed = 1, left = spp;
      for (size_t b = image.offsets[p]; b < image.offsets[p + 1]; ++b) {
        const double n = double(count[b]), ulp = double(std::nextafter(alpha[b], 2.0f) - alpha[b]);
        if (n == left)
          EXPECT_EQ(alpha[b], 1);
        else
          EXPECT_NEAR(passed * double(alpha[b]), n / spp, 0.51 * ulp * passed) << "bin " << b << " of pixel " << p;
        passed *= 1 - double(alpha[b]);
        left -= n;
      }
    }
  }
}

TEST(Cluster, SppIsToldByTheAlphasWhereNoAttributeTells) {
  DeepImage samples = cameraImage(randomPixels(100, 32, 3), 32, 10);
  const DeepImage expected = clustered(samples);
  samples.attributes.erase("fathom:spp");
  EXPECT_EQ(listOf(clustered(samples).get("A")), listOf(expected.get("A")));
  samples.attributes.set("fathom:spp", 48);  // of another render: the alphas know better
  EXPECT_EQ(listOf(clustered(samples).get("A")), listOf(expected.get("A")));
}

TEST(Cluster, FlatteningIsUnchanged) {
  const DeepImage camera = cameraImage(randomPixels(300, 16, 4), 16, 20);
  DeepImage other = makeDeep(randomSamples(500, 5), 20, false);
  other.attributes.set("fathom:spp", 1);  // samples at the same depth: one behind the other
  for (const DeepImage* samples : std::initializer_list<const DeepImage*>{&camera, &other}) {
    const flat::Image before = flatten(sortSamples(samples->copy())), after = flatten(clustered(*samples));
    for (const char* name : {"R", "B", "A"})
      for (size_t p = 0; p < samples->pixels(); ++p)
        EXPECT_NEAR(after.get(name).values[p], before.get(name).values[p], 3e-6f * (1 + before.get(name).values[p]))
            << name << " " << p;
  }
}

TEST(Cluster, HalvesAreBalancedAndMakeTheMean) {
  for (const int spp : {2, 7, 16}) {
    std::mt19937 random(6);
    std::vector<std::vector<CameraSample>> pixels(100);
    for (auto& pixel : pixels) pixel = randomCameraSamples(size_t(spp), random);
    const DeepImage image = clustered(cameraImage(pixels, spp, 10));
    const auto n0 = image.get("half0.samples"), n1 = image.get("half1.samples"), n = image.get("samples");
    const auto c0 = image.get("half0.R"), c1 = image.get("half1.R"), c = image.get("R");
    for (size_t p = 0; p < image.pixels(); ++p) {
      float even = 0;
      for (size_t b = image.offsets[p]; b < image.offsets[p + 1]; ++b) {
        EXPECT_EQ(n0[b] + n1[b], n[b]);
        EXPECT_NEAR((n0[b] * c0[b] + n1[b] * c1[b]) / n[b], c[b], 1e-6 * double(c[b]));
        even += n0[b];
      }
      EXPECT_EQ(int(even), (spp + 1) / 2);
    }
  }
}

TEST(Cluster, HalvesAreUnbiased) {
  // The value grows with depth: halves that took turns in depth would differ in one direction, and too little.
  constexpr int kPixels = 20000, kSpp = 8;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<std::vector<CameraSample>> pixels(kPixels);
  for (auto& pixel : pixels)
    for (int i = 0; i < kSpp; ++i) {
      const double x = uniform(random);
      pixel.push_back({double(float(1 + 1e-4 * x)), x});
    }
  const DeepImage image = clustered(cameraImage(pixels, kSpp, 200));
  ASSERT_EQ(image.samples(), size_t(kPixels));
  const auto c0 = image.get("half0.R"), c1 = image.get("half1.R"), v = image.get("variance.R");
  double bias = 0, twoBuffer = 0, variance = 0;
  for (size_t b = 0; b < image.samples(); ++b) {
    const double d = double(c0[b]) - double(c1[b]);
    bias += d / kPixels;
    twoBuffer += d * d / 4 / kPixels;
    variance += double(v[b]) / kPixels;
  }
  const double expected = 1.0 / 12 / kSpp;  // of the mean of uniform values
  EXPECT_NEAR(variance, expected, 0.02 * expected);
  EXPECT_NEAR(twoBuffer, expected, 0.04 * expected);
  EXPECT_NEAR(bias, 0, 4 * std::sqrt(4 * expected / kPixels));
}

TEST(Cluster, WhichHalfASampleIsInTellsNothingOfItsPlace) {
  // The front sample alone in its bin: half of the pixels have it in half 0, also where some camera samples saw
  // nothing.
  std::vector<std::vector<CameraSample>> pixels(4000, {{1, 1}, {50, 1}, {51, 1}});
  const DeepImage image = clustered(cameraImage(pixels, 4, 50));
  double first = 0;
  for (size_t p = 0; p < image.pixels(); ++p) first += double(image.get("half0.samples")[image.offsets[p]]) / 4000;
  EXPECT_NEAR(first, 0.5, 4 * 0.5 / std::sqrt(4000));
}

TEST(Cluster, OtherSamplesCountByEffectiveAlpha) {
  const DeepImage image =
      clustered(makeDeep({{{1, 1, 0.5f, 1.0f, 5}, {1.001f, 1.001f, 0.8f, 0.8f, 6}, {9, 9, 1, 3, 7}}}, 1, false));
  ASSERT_EQ(image.samples(), 2u);
  EXPECT_FLOAT_EQ(image.get("A")[0], 0.9f);
  EXPECT_FLOAT_EQ(image.get("R")[0], 1.4f);
  EXPECT_THAT(listOf(image.get("samples")), ElementsAre(2, 1));
  // Values 2 and 1 with weights 0.5 and 0.4.
  const double mean = 1.4 / 0.9, part = (0.25 + 0.16) / 0.81;
  const double scatter = (0.5 * (2 - mean) * (2 - mean) + 0.4 * (1 - mean) * (1 - mean)) / 0.9;
  EXPECT_NEAR(image.get("variance.R")[0], scatter * part / (1 - part), 1e-6);
  EXPECT_EQ(image.get("variance.R")[1], 0);
  EXPECT_THAT(listOf(image.find("id")->ids), ElementsAre(5u, 7u));
}

TEST(Cluster, EmissionIsKept) {
  const DeepImage image = clustered(
      makeDeep({{{1, 1, 0, 2, 1}, {1.001f, 1, 0, 3, 1}, {9, 9, 0, 7, 1}, {9.001f, 9, 0.5f, 1, 1}}}, 1, false));
  ASSERT_EQ(image.samples(), 2u);
  EXPECT_THAT(listOf(image.get("A")), ElementsAre(0, 0.5f));
  EXPECT_THAT(listOf(image.get("R")), ElementsAre(5, 8));
  EXPECT_EQ(image.get("half0.R")[0] + image.get("half1.R")[0], 10);
}

TEST(Cluster, IdsGoByTheLargestShare) {
  std::vector<Sample> samples = asDeepSamples({{1, 1}, {1.0001, 1}, {1.0002, 1}, {1.0003, 1}, {1.0004, 1}}, 8);
  const uint32_t ids[] = {9, 4'000'000'001u, 3, 9, 4'000'000'001u};
  for (size_t i = 0; i < samples.size(); ++i) samples[i].id = ids[i];
  EXPECT_EQ(clustered(makeDeep({samples}, 1, false)).find("id")->ids[0], 9u);
  samples[2].id = 4'000'000'001u;
  EXPECT_EQ(clustered(makeDeep({samples}, 1, false)).find("id")->ids[0], 4'000'000'001u);
}

TEST(Cluster, PoisonedSamplesHaveNoSay) {
  for (const float poison : {kNan, kInfinity, -1e16f}) {
    std::vector<Sample> samples = asDeepSamples({{1, 1}, {1.0001, 2}, {1.0002, 3}, {1.0003, 4}}, 4);
    samples[1].colour = poison;
    const DeepImage image = clustered(makeDeep({samples}, 1, false));
    EXPECT_EQ(image.get("A")[0], 1);
    EXPECT_EQ(image.get("samples")[0], 4);
    EXPECT_EQ(image.get("half0.samples")[0] + image.get("half1.samples")[0], 3);
    EXPECT_FLOAT_EQ(image.get("R")[0], 8.0f / 3);
    EXPECT_FLOAT_EQ(image.get("variance.R")[0], 14.0f / 3 / 2 / 3);
    EXPECT_TRUE(std::isfinite(image.get("half0.R")[0]) && std::isfinite(image.get("half1.R")[0]));
  }
}

TEST(Cluster, ABinOfPoisonAloneIsBlack) {
  const DeepImage image = clustered(makeDeep({asDeepSamples({{1, double(kNan)}}, 2)}, 1, false));
  EXPECT_EQ(image.get("A")[0], 0.5f);
  for (const char* name : {"R", "half0.R", "half1.R", "variance.R", "half0.samples"})
    EXPECT_EQ(image.get(name)[0], 0) << name;
}

TEST(Cluster, PlainChannelsAreAveraged) {
  DeepImage samples = makeDeep({asDeepSamples({{1, 1}, {1.0001, 1}}, 8)}, 1, false);
  Buffer<float>& coc = samples.add("coc", PixelType::Half).values;
  coc[0] = 3;
  coc[1] = 5;
  const DeepImage image = clustered(samples);
  EXPECT_EQ(image.get("coc")[0], 4);
  EXPECT_EQ(image.find("coc")->type, PixelType::Half);
}

TEST(Cluster, ChannelsFollowTheConvention) {
  DeepImage samples = makeDeep({asDeepSamples({{1, 1}}, 2)}, 1);
  for (const char* name : {"diffuse.R", "N.X", "albedo.G", "emission.R"})
    samples.add(name, PixelType::Half).values.fill(0.25f);
  std::vector<std::string> names;
  for (const Channel& channel : clustered(samples).channels) names.push_back(channel.name);
  EXPECT_THAT(names, testing::UnorderedElementsAre(
                         "R", "B", "A", "Z", "ZBack", "id", "diffuse.R", "N.X", "albedo.G", "emission.R", "variance.R",
                         "variance.B", "variance.diffuse.R", "variance.albedo.G", "variance.N.X", "variance.Z",
                         "half0.R", "half1.R", "half0.B", "half1.B", "half0.diffuse.R", "half1.diffuse.R",
                         "half0.albedo.G", "half1.albedo.G", "samples", "half0.samples", "half1.samples"));
}

TEST(Cluster, VolumesBecomeTidyExtents) {
  const DeepImage image = clustered(makeDeep(
      {{{1, 1.4f, 0.25f, 1, 1}, {1.1f, 1.3f, 1 / 3.0f, 1, 1}, {4, 6, 0.5f, 1, 1}, {3, 9, 1, 1, 1}}, {{2, 2, 1, 1, 1}}},
      2));
  EXPECT_THAT(listOf(image.get("Z")), ElementsAre(1, 4, testing::FloatEq(5.5f), 2));
  EXPECT_TRUE(isTidy(image));
  EXPECT_EQ(image.get("ZBack")[2], 9);
  EXPECT_EQ(image.get("ZBack")[3], 2);
  Pixels pixels = randomSamples(400, 9);
  std::mt19937 random(10);
  std::uniform_real_distribution<float> length(0, 0.5f);
  for (auto& pixel : pixels)
    for (Sample& sample : pixel) sample.zBack += std::max(0.0f, length(random) - 0.2f);
  EXPECT_TRUE(isTidy(clustered(makeDeep(pixels, 20), {.E = 1, .first = 0})));
}

TEST(Cluster, ItsOwnBinsAgainAreTheSame) {
  const DeepImage samples = cameraImage(randomPixels(200, 32, 11), 32, 20);
  const DeepImage once = clustered(samples);
  DeepImage depths = once.copyLayout();
  std::copy_n(once.get("Z").begin(), once.samples(), depths.add("Z", PixelType::Float).values.begin());
  const DeepImage again = cluster(samples, layoutFrom(depths));
  for (const char* name : {"Z", "A", "R", "samples", "half1.R"})
    EXPECT_EQ(listOf(again.get(name)), listOf(once.get(name))) << name;
}

TEST(Cluster, APrepassGivesDepthsAndAlphas) {
  const DeepImage samples = cameraImage({{{1, 1}, {1.1, 3}, {5, 7}}, {{2, 1}}, {{3, 1}}}, 4, 3);
  // Bins in any order; the second pixel has one that no sample reaches, the third has none.
  DeepImage prepass =
      makeDeep({{{6, 6, 0.75f, 0, 0}, {1, 1, 0.5f, 0, 0}}, {{2, 2, 0.25f, 0, 0}, {9, 9, 0.125f, 0, 0}}, {}}, 3, false);
  const DeepImage image = cluster(samples, layoutFrom(prepass));
  EXPECT_THAT(listOf(image.offsets), ElementsAre(0u, 2u, 4u, 4u));
  EXPECT_THAT(listOf(image.get("Z")), ElementsAre(1, 6, 2, 9));
  EXPECT_THAT(listOf(image.get("A")), ElementsAre(0.5f, 0.75f, 0.25f, 0.125f));
  EXPECT_THAT(listOf(image.get("samples")), ElementsAre(2, 1, 1, 0));
  EXPECT_THAT(listOf(image.get("R")), ElementsAre(1, 5.25f, 0.25f, 0));
  prepass.dataWindow.x0 += 1;  // another window: the bins belong to the pixels one to the right
  prepass.dataWindow.x1 += 1;
  EXPECT_THAT(listOf(cluster(samples, layoutFrom(prepass)).get("Z")), ElementsAre(1, 6, 2, 9));
  EXPECT_EQ(cluster(samples, layoutFrom(prepass)).count(0), 0u);
}

TEST(Cluster, APrepassWithoutAlphasTakesThoseOfTheSamples) {
  const DeepImage samples = cameraImage({{{1, 1}, {1.1, 3}, {5, 7}}}, 4, 1);
  DeepImage prepass = makeDeep({{{1, 1}, {6, 6}}}, 1, false);
  prepass.erase("A");
  EXPECT_THAT(listOf(cluster(samples, layoutFrom(prepass)).get("A")), ElementsAre(0.5f, 0.5f));
}

TEST(Cluster, OneSampleAndEmptyPixels) {
  const DeepImage image = clustered(cameraImage({{}, {{2, 3}}, {}}, 4, 3));
  EXPECT_THAT(listOf(image.offsets), ElementsAre(0u, 0u, 1u, 1u));
  EXPECT_EQ(image.get("A")[0], 0.25f);
  EXPECT_EQ(image.get("R")[0], 0.75f);
  EXPECT_EQ(image.get("variance.R")[0], 0);
}

TEST(Cluster, RefusesBins) {
  const DeepImage bins = clustered(cameraImage({{{2, 3}}}, 4, 1));
  try {
    cluster(bins, layoutFrom(bins));
    FAIL() << "expected an error";
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("clustered before"));
  }
}

TEST(Cluster, NeedsAlphaAndDepth) {
  for (const char* name : {"A", "Z"}) {
    DeepImage samples = cameraImage({{{2, 3}}}, 4, 1);
    const BinLayout layout = findBins(samples, kPpuScale);
    samples.erase(name);
    EXPECT_THROW(cluster(samples, layout), Error);
  }
}

TEST(Cluster, TheSameBitsForAnyThreadsAndBands) {
  const DeepImage samples = cameraImage(randomPixels(300, 16, 12), 16, 20);
  const DeepImage whole = clustered(samples);
  const auto expectSame = [](const DeepImage& a, const DeepImage& b) {
    ASSERT_EQ(a.samples(), b.samples());
    for (const Channel& channel : a.channels) {
      if (channel.type == PixelType::Uint) continue;
      EXPECT_EQ(std::memcmp(channel.values.data(), b.get(channel.name).data(), 4 * a.samples()), 0) << channel.name;
    }
  };
  for (const size_t threads : {1, 2, 5}) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    expectSame(clustered(samples), whole);
  }
  for (int y = samples.dataWindow.y0; y < samples.dataWindow.y1; y += 3)
    expectSame(clustered(rows(samples, y, y + 3)), rows(whole, y, y + 3));
}

}  // namespace
}  // namespace fathom::deep
