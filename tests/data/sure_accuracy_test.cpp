// Estimated errors against true ones, and the mix against its base, on renders with references.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "deep/denoise.h"
#include "deep/error_estimate.h"
#include "deep/flat_nl_means.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/error_summary.h"
#include "flat/io.h"
#include "flat/metrics.h"
#include "flat/progressive.h"
#include "tests/reference/pixel_map.h"

namespace fathom::flat {
namespace {

using reference::boxMean;
using reference::PixelMap;  // sums over R, G and B
using reference::spearman;
using reference::sum;

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

// Our own filter tells its response by itself: sums too small by a fifth on average, since its weights know a little of
// what they average; maps, of which its smooth spread is the better part, and the mix are as good as by probes.
TEST_P(SureAccuracy, TheFiltersOwnEstimateFollowsTheTruth) {
  deep::FlatAnswer answer = deep::answerNlMeans(noisy, deep::planFlat(noisy, {.gate = false}));
  const Image& denoised = answer.denoised;
  ErrorEstimate estimate = estimateError(noisy, noise, denoised, std::move(answer.response));
  const ErrorEstimate probes = estimateError(noisy, noise, denoised, denoiser);
  const PixelMap errors = truth(denoised);
  EXPECT_NEAR(std::log(sum(total(estimate.covariance)) / sum(total(probes.covariance))), -0.12, std::log(1.2));
  EXPECT_GT(sum(total(estimate.error)) / sum(errors), 0.45);
  EXPECT_LT(sum(total(estimate.error)) / sum(errors), 1.2);
  const int width = noisy.dataWindow.width(), height = noisy.dataWindow.height();
  const PixelMap map = total(mapErrors(estimate, noise, denoised).error);
  EXPECT_NEAR(std::log(sum(map) / sum(errors)), 0, std::log(1.6));
  EXPECT_GT(spearman(boxMean(map, width, height), boxMean(errors, width, height)), 0.68);

  std::vector<Candidate> candidates;
  candidates.push_back(makeCandidate(noisy, noise, {denoised.copy(), std::move(estimate)}));
  const Image mixed = mixCandidates(noisy, noise, candidates);
  const double error = relMse(mixed);
  EXPECT_LT(error, 1.02 * std::min(relMse(denoised), relMse(noisy)));
  EXPECT_NEAR(summarizeErrors(mixed, noise).relMse / error, 1, 0.3);
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

// The same of deep frames, whose alphas are noisy, too.
TEST_P(SureAccuracy, FollowsTheTruthOfDeepFrames) {
  const deep::DeepImage bins = deep::read(render(".deep.exr"));
  std::vector<std::string> names;
  for (const deep::Channel& channel : bins.channels) names.push_back(channel.name);
  const deep::DenoisePlan plan{deep::findDenoiseInputs(names, bins.attributes), {}, deep::meanLevel(bins)};
  const auto denoise = [&](deep::DeepImage image, const Progress&) { return deep::denoise(std::move(image), plan); };
  deep::DeepImage denoised = denoise(bins.copy(), {});
  deep::addFlattenedErrors(bins, plan.inputs, denoise, {}, {}, denoised);
  const Image result = deep::flatten(denoised);
  PixelMap estimate(result.dataWindow.area(), 0.0);
  for (const char* name : {"error.R", "error.G", "error.B"})
    for (size_t i = 0; i < estimate.size(); ++i) estimate[i] += double(result.get(name).values[i]);
  const PixelMap errors = truth(result);
  EXPECT_NEAR(std::log(sum(estimate) / sum(errors)), 0, std::log(2.2));
  const int width = result.dataWindow.width(), height = result.dataWindow.height();
  EXPECT_GT(spearman(boxMean(estimate, width, height), boxMean(errors, width, height)), 0.6);
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
