// The measures against closed forms, against their plain twins, and against what must hold for any image.
#include "flat/metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>
#include <random>

#include "base/error.h"
#include "flat/tonemap.h"
#include "tests/reference/metrics.h"

namespace fathom::flat {
namespace {

using ::testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

Image makeImage(int width, int height, float value = 0) {
  Image image{{0, 0, width, height}, {0, 0, width, height}, {}, {}};
  for (const char* name : {"R", "G", "B"}) image.add(name, value);
  return image;
}

Image makeNoise(int width, int height, unsigned seed) {
  Image image = makeImage(width, height);
  std::mt19937 random(seed);
  std::lognormal_distribution<float> bright(-1, 1.5f);
  for (Plane& plane : image.planes)
    for (float& value : plane.values) value = bright(random);
  return image;
}

void addVariance(Image& image, float value) {
  for (const char* name : {"variance.R", "variance.G", "variance.B"}) image.add(name, value);
}

reference::Picture pictureOf(const Image& image) {
  reference::Picture picture{image.dataWindow.width(), image.dataWindow.height(), {}};
  for (size_t c = 0; c < 3; ++c) picture.values[c].assign(image.planes[c].values.begin(), image.planes[c].values.end());
  return picture;
}

std::string errorOf(const Image& image, const Image& reference, const MetricParams& params = {}) {
  try {
    compare(image, reference, params);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

TEST(ToneMap, RisesFromBlackToWhiteForAnyValue) {
  EXPECT_EQ(toneMap(-kInfinity), 0);
  EXPECT_EQ(toneMap(-1), 0);
  EXPECT_EQ(toneMap(0), 0);
  EXPECT_EQ(toneMap(kNan), 0);
  EXPECT_NEAR(toneMap(1), srgb(0.5), 1e-15);
  EXPECT_NEAR(toneMap(0.002), 12.92 * 0.002 / 1.002, 1e-15);
  EXPECT_LT(toneMap(100), toneMap(1000));
  EXPECT_EQ(toneMap(1e300), 1);
  EXPECT_EQ(toneMap(kInfinity), 1);
}

TEST(Metrics, EqualImagesHaveNoError) {
  const Image image = makeNoise(30, 20, 1);
  const Metrics m = compare(image, image);
  EXPECT_EQ(m.relMse, 0);
  EXPECT_EQ(m.relMseTrimmed, 0);
  EXPECT_EQ(m.mse, 0);
  EXPECT_EQ(m.psnr, std::numeric_limits<double>::infinity());
  EXPECT_EQ(m.smape, 0);
  EXPECT_DOUBLE_EQ(m.ssim, 1);
  EXPECT_EQ(m.pixels, 600u);
  EXPECT_EQ(m.excluded, 0u);
  EXPECT_FALSE(m.ownRelMse);
}

TEST(Metrics, ConstantImagesHaveClosedForms) {
  const Metrics m = compare(makeImage(16, 12, 0.75f), makeImage(16, 12, 0.5f));
  EXPECT_DOUBLE_EQ(m.relMse, 0.0625 / 0.26);
  EXPECT_DOUBLE_EQ(m.relMseTrimmed, 0.0625 / 0.26);
  EXPECT_DOUBLE_EQ(m.mse, 0.0625);
  EXPECT_DOUBLE_EQ(m.smape, 0.25 / 1.26);
  const double a = reference::toneMap(0.75), r = reference::toneMap(0.5);
  EXPECT_NEAR(m.psnr, -20 * std::log10(a - r), 1e-9);
  EXPECT_NEAR(m.ssim, (2 * a * r + 1e-4) / (a * a + r * r + 1e-4), 1e-7);
}

TEST(Metrics, NegativeAndUnknownValues) {
  EXPECT_DOUBLE_EQ(compare(makeImage(16, 12, 0.75f), makeImage(16, 12, -0.5f)).smape, 1.25 / 1.26);
  Image reference = makeImage(20, 20, 0.5f);
  addVariance(reference, 0.0125f);
  for (const float odd : {-1.0f, std::numeric_limits<float>::quiet_NaN(), 1e20f}) {
    for (const char* name : {"variance.R", "variance.G", "variance.B"}) reference.find(name)->values[0] = odd;
    EXPECT_NEAR(*compare(makeImage(20, 20, 0.75f), reference).ownMse, 0.0125 * 399 / 400, 1e-8) << odd;
  }
}

TEST(Metrics, NoiseAgreesWithThePlainTwin) {
  for (const int width : {11, 12, 37}) {
    const Image image = makeNoise(width, 23, 2), other = makeNoise(width, 23, 3);
    const Metrics m = compare(image, other);
    const reference::Picture a = pictureOf(image), r = pictureOf(other);
    EXPECT_NEAR(m.relMse, reference::relMse(a, r), 1e-12 * m.relMse);
    EXPECT_NEAR(m.smape, reference::smape(a, r), 1e-12);
    EXPECT_NEAR(m.ssim, reference::ssim(a, r), 1e-6) << width;
  }
}

TEST(Metrics, SsimOfImagesSmallerThanAWindow) {
  const Image image = makeNoise(4, 3, 4);
  EXPECT_DOUBLE_EQ(compare(image, image).ssim, 1);
  EXPECT_LT(compare(image, makeNoise(4, 3, 5)).ssim, 0.9);
  EXPECT_EQ(compare(makeNoise(1, 1, 4), makeNoise(1, 1, 4)).ssim, 1);
  EXPECT_LT(compare(makeNoise(10, 10, 4), makeNoise(10, 10, 5)).ssim, 0.9);
}

TEST(Metrics, SsimIsOneWhereNoWindowIsWhole) {
  Image reference = makeNoise(20, 20, 4);
  reference.add("A", 0).values[0] = 1;
  EXPECT_EQ(compare(makeNoise(20, 20, 5), reference, {.onlyCovered = true}).ssim, 1);
}

TEST(Metrics, TrimmingTakesTheFireflies) {
  Image image = makeImage(100, 40, 0.5f);
  const Image reference = image.copy();
  for (const size_t i : {17, 1717, 2222, 3999}) image.planes[1].values[i] = 1e6f;
  EXPECT_GT(compare(image, reference).relMse, 1e6);
  EXPECT_EQ(compare(image, reference).relMseTrimmed, 0);
  image.planes[2].values[0] = 0.6f;
  const double left = double(0.6f - 0.5f) * double(0.6f - 0.5f) / 0.26 / (3 * 3996);
  EXPECT_NEAR(compare(image, reference).relMseTrimmed, left, 1e-12);
}

TEST(Metrics, TheReferencesOwnErrorIsToldAndTakenOff) {
  const Image image = makeImage(20, 20, 0.75f);
  Image reference = makeImage(20, 20, 0.5f);
  addVariance(reference, 0.0125f);
  const Metrics plain = compare(image, reference), corrected = compare(image, reference, {.correct = true});
  EXPECT_NEAR(*plain.ownRelMse, 0.0125 / 0.26, 1e-8);
  EXPECT_NEAR(*plain.ownMse, 0.0125, 1e-8);
  EXPECT_NEAR(corrected.relMse, plain.relMse - *plain.ownRelMse, 1e-12);
  EXPECT_NEAR(corrected.relMseTrimmed, plain.relMse - *plain.ownRelMse, 1e-12);
  EXPECT_NEAR(corrected.mse, plain.mse - *plain.ownMse, 1e-12);
  EXPECT_THAT(errorOf(image, makeImage(20, 20), {.correct = true}), HasSubstr("variance.R: expected"));
}

// A noisy image against a noisy reference of known variance: correction finds the error against the truth.
TEST(Metrics, CorrectionIsUnbiased) {
  Image image = makeImage(200, 200), reference = makeImage(200, 200), truth = makeImage(200, 200, 0.5f);
  std::mt19937 random(6);
  std::normal_distribution<float> unit;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < 40000; ++i) {
      image.planes[c].values[i] = 0.5f + 0.2f * unit(random);
      reference.planes[c].values[i] = 0.5f + 0.2f * unit(random);
    }
  addVariance(reference, 0.04f);
  const double expected = compare(image, truth).mse;
  EXPECT_NEAR(compare(image, reference, {.correct = true}).mse, expected, 0.02 * expected);
  EXPECT_GT(compare(image, reference).mse, 1.9 * expected);
}

TEST(Metrics, PixelsThatAreNotFiniteAreCountedAndHaveNoSay) {
  const Image reference = makeNoise(40, 30, 7);
  Image image = makeNoise(40, 30, 8), clean = image.copy();
  Image brokenReference = reference.copy();
  image.planes[0].values[5] = kNan;
  image.planes[1].values[5] = -kInfinity;
  image.planes[2].values[600] = 2e15f;
  brokenReference.planes[1].values[7] = kInfinity;
  const Metrics m = compare(image, brokenReference);
  EXPECT_EQ(m.excluded, 3u);
  EXPECT_EQ(m.pixels, 1197u);
  // Another broken value in the same place changes nothing.
  image.planes[0].values[5] = kInfinity;
  const Metrics again = compare(image, brokenReference);
  EXPECT_EQ(again.relMse, m.relMse);
  EXPECT_EQ(again.ssim, m.ssim);
  for (const double value : {m.relMse, m.relMseTrimmed, m.mse, m.psnr, m.smape, m.ssim})
    EXPECT_TRUE(std::isfinite(value));
  EXPECT_TRUE(std::isnan(relativeError(image, brokenReference).values[5]));
  EXPECT_NEAR(m.relMse, compare(clean, reference).relMse, 0.2 * m.relMse);

  Image broken = makeImage(3, 3, kNan);
  EXPECT_THAT(errorOf(broken, makeImage(3, 3)), HasSubstr("found none that are finite"));
}

TEST(Metrics, PixelsThatAreNotFiniteLeaveTheWindowsAroundThemAlone) {
  Image image = makeImage(20, 16, 0.75f);
  const Image reference = makeImage(20, 16, 0.5f);
  const double whole = compare(image, reference).ssim;
  image.planes[1].values[170] = kNan;
  EXPECT_NEAR(compare(image, reference).ssim, whole, 1e-9);
}

TEST(Metrics, OnlyCoveredPixelsWhenAsked) {
  Image reference = makeImage(10, 10, 0.5f), image = makeImage(10, 10, 0.5f);
  reference.add("A", 0).values[44] = 0.25f;
  image.planes[0].values[44] = image.planes[0].values[45] = 1.5f;
  const Metrics m = compare(image, reference, {.onlyCovered = true});
  EXPECT_EQ(m.pixels, 1u);
  EXPECT_DOUBLE_EQ(m.relMse, 1 / 0.26 / 3);
}

TEST(Metrics, WindowsAndChannelsMustFit) {
  EXPECT_THAT(errorOf(makeImage(4, 4), makeImage(5, 4)),
              HasSubstr("expected the data window of the reference, (0, 0) to (4, 3), found (0, 0) to (3, 3)"));
  Image noBlue = makeImage(4, 4);
  noBlue.planes.pop_back();
  EXPECT_THAT(errorOf(noBlue, makeImage(4, 4)), HasSubstr("channel B: expected"));
}

TEST(Metrics, RelativeErrorIsTheRootOfThePixelsShare) {
  const Image image = makeNoise(9, 8, 9), reference = makeNoise(9, 8, 10);
  const Plane error = relativeError(image, reference);
  double sum = 0;
  for (const float e : error.values) sum += double(e) * e;
  EXPECT_NEAR(sum / 72, compare(image, reference).relMse, 1e-6 * sum);
}

TEST(Metrics, AnErrorThatStandsStillDoesNotFlicker) {
  const Image reference0 = makeImage(20, 20, 0.25f), reference1 = makeImage(20, 20, 0.5f);
  EXPECT_EQ(flicker(makeImage(20, 20, 0.5f), reference0, makeImage(20, 20, 0.75f), reference1), 0);
  EXPECT_DOUBLE_EQ(flicker(makeImage(20, 20, 0.25f), reference0, makeImage(20, 20, 0.75f), reference1), 0.0625 / 0.26);
}

TEST(Metrics, FlickerNeedsBothFramesFiniteAndTakesBothVariancesOff) {
  Image before = makeImage(20, 20, 0.25f), after = makeImage(20, 20, 0.75f), reference = makeImage(20, 20, 0.5f);
  before.planes[0].values[7] = after.planes[2].values[8] = kNan;
  EXPECT_DOUBLE_EQ(flicker(before, reference, after, reference), 0.25 / 0.26);
  addVariance(reference, 0.03125f);
  EXPECT_NEAR(flicker(before, reference, after, reference, {.correct = true}), 0.1875 / 0.26, 1e-12);
}

TEST(Metrics, VariancesOfTwoColoursSayNothing) {
  const Image image = makeImage(20, 20, 0.75f);
  Image reference = makeImage(20, 20, 0.5f);
  for (const char* name : {"variance.R", "variance.G"}) reference.add(name, 0.0125f);
  EXPECT_FALSE(compare(image, reference).ownRelMse);
  EXPECT_THAT(errorOf(image, reference, {.correct = true}), HasSubstr("channel variance.R: expected"));
}

TEST(Metrics, FlickerIsOfOneWindow) {
  const Image before = makeImage(4, 4), after = makeImage(5, 4);
  try {
    flicker(before, before, after, after);
    FAIL();
  } catch (const Error& e) {
    EXPECT_STREQ(e.what(), "expected the data window of the frame before, (0, 0) to (3, 3), found (0, 0) to (4, 3)");
  }
}

TEST(Metrics, IndependentErrorsFlickerTwice) {
  const Image reference = makeImage(100, 100, 1);
  const auto noisy = [](unsigned seed) {
    Image image = makeImage(100, 100);
    std::mt19937 random(seed);
    std::normal_distribution<float> around(1, 0.1f);
    for (Plane& plane : image.planes)
      for (float& value : plane.values) value = around(random);
    return image;
  };
  const double single = compare(noisy(1), reference).relMse;
  EXPECT_NEAR(flicker(noisy(1), reference, noisy(2), reference), 2 * single, 0.05 * single);
}

TEST(Metrics, SameBitsForAnyNumberOfThreads) {
  const Image image = makeNoise(64, 51, 11), reference = makeNoise(64, 51, 12);
  const Metrics expected = compare(image, reference);
  for (const size_t threads : {1, 2, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const Metrics m = compare(image, reference);
    EXPECT_EQ(m.relMse, expected.relMse);
    EXPECT_EQ(m.smape, expected.smape);
    EXPECT_EQ(m.ssim, expected.ssim);
  }
}

}  // namespace
}  // namespace fathom::flat
