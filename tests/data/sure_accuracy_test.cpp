// Estimated errors against true ones, and the mix against its base, on renders with references.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "deep/flat_nl_means.h"
#include "flat/error_summary.h"
#include "flat/io.h"
#include "flat/metrics.h"
#include "flat/progressive.h"

namespace fathom::flat {
namespace {

// Sums over R, G and B per pixel.
using PixelMap = std::vector<double>;

PixelMap boxMean(const PixelMap& in, int width, int height) {
  PixelMap result(in.size());
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double sum = 0;
      int count = 0;
      for (int yq = std::max(0, y - 5); yq <= std::min(height - 1, y + 5); ++yq)
        for (int xq = std::max(0, x - 5); xq <= std::min(width - 1, x + 5); ++xq, ++count)
          sum += in[size_t(yq * width + xq)];
      result[size_t(y * width + x)] = sum / count;
    }
  return result;
}

PixelMap ranks(const PixelMap& values) {
  std::vector<size_t> order(values.size());
  std::iota(order.begin(), order.end(), size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return values[a] < values[b]; });
  PixelMap result(values.size());
  for (size_t i = 0; i < order.size(); ++i) result[order[i]] = double(i);
  return result;
}

double spearman(const PixelMap& a, const PixelMap& b) {
  const PixelMap x = ranks(a), y = ranks(b);
  const double mean = double(x.size() - 1) / 2;
  double xy = 0, xx = 0, yy = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    xy += (x[i] - mean) * (y[i] - mean);
    xx += (x[i] - mean) * (x[i] - mean);
    yy += (y[i] - mean) * (y[i] - mean);
  }
  return xy / std::sqrt(xx * yy);
}

double sum(const PixelMap& map) {
  return std::accumulate(map.begin(), map.end(), 0.0);
}

class SureAccuracy : public ::testing::TestWithParam<const char*> {
 protected:
  static std::string render(const std::string& end) {
    return FATHOM_SHARED "/renders/" + std::string(GetParam()) + end;
  }
  PixelMap total(const std::array<Buffer<float>, 3>& planes) const {
    PixelMap result(noisy.dataWindow.area(), 0.0);
    for (const Buffer<float>& plane : planes)
      for (size_t i = 0; i < result.size(); ++i) result[i] += double(plane[i]);
    return result;
  }
  // Squared errors less the reference's own.
  PixelMap truth(const Image& image) const {
    PixelMap result(noisy.dataWindow.area(), 0.0);
    for (const char* c : kRgbNames)
      for (size_t i = 0; i < result.size(); ++i) {
        const double e = double(image.get(c).values[i]) - double(reference.get(c).values[i]);
        result[i] += e * e - double(reference.get(std::string("variance.") + c).values[i]);
      }
    return result;
  }
  double relMse(const Image& image) const { return compare(image, reference, {.correct = true}).relMse; }

  const Image noisy = read(render(".flat.exr")), reference = read(render(".ref.exr"));
  const Denoiser denoiser = deep::flatNlMeans(deep::planFlat(noisy, {.gate = false}));
  const Noise noise = noiseOf(noisy);
};

// What an unbiased estimate can be off by is bounded by its own noise, of which most is that of (y - truth)^2 - s^2.
// For normal noise its variance is 2 s^4, three times that for sums of three channels that are alike.
TEST_P(SureAccuracy, SumAndMapFollowTheTruth) {
  const Image denoised = denoiser(noisy, {});
  const ErrorEstimate estimate = estimateError(noisy, noise, denoised, denoiser);
  const PixelMap errors = truth(denoised);
  double s4 = 0;
  for (const Buffer<float>& variance : noise.variance)
    for (const float v : variance) s4 += double(v) * double(v);
  const double own = 2 * std::sqrt(3 * 2 * s4) / sum(errors);
  EXPECT_NEAR(sum(total(estimate.error)) / sum(errors), 1, std::max(0.15, own));

  const int width = noisy.dataWindow.width(), height = noisy.dataWindow.height();
  const PixelMap map = total(mapErrors(estimate, noise, denoised).error);
  EXPECT_GT(spearman(boxMean(map, width, height), boxMean(errors, width, height)), 0.6);
}

TEST_P(SureAccuracy, TheMixIsNoWorseThanItsPartsAndKnowsItsError) {
  const Image mixed = denoiseProgressively(noisy, denoiser);
  const double error = relMse(mixed), ofBase = relMse(denoiser(noisy, {})), ofRender = relMse(noisy);
  EXPECT_LT(error, 1.02 * ofBase);
  EXPECT_LT(error, 1.02 * ofRender);
  if (GetParam() == std::string("fur")) {
    EXPECT_LT(error, 0.95 * std::min(ofBase, ofRender));
  }
  EXPECT_NEAR(summarizeErrors(mixed, noise).relMse / error, 1, 0.3);
}

TEST_P(SureAccuracy, TheGateDoesNoHarm) {
  const Image denoised = denoiser(noisy, {});
  EXPECT_LT(relMse(gated(noisy, noise, denoised)), 1.01 * relMse(denoised));
}

INSTANTIATE_TEST_SUITE_P(Renders, SureAccuracy,
                         ::testing::Values("staircase2", "fur", "coffee", "bathroom2", "staircase", "veach-ajar",
                                           "living-room", "kitchen"),
                         [](const auto& test) {
                           std::string name = test.param;
                           std::erase(name, '-');
                           return name;
                         });

}  // namespace
}  // namespace fathom::flat
