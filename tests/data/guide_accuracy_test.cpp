// What guides reach on renders with references: the flattened frame is as good as its guide or better, bins get better
// and not worse, and so do the pixels that a clip plane cuts.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "deep/base_guide.h"
#include "deep/compare.h"
#include "deep/denoise.h"
#include "deep/flat_nl_means.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"
#include "flat/oidn.h"
#include "tests/oidn/installed.h"

namespace fathom::deep {
namespace {

constexpr std::array kFrames{"staircase2", "fur",        "coffee",      "bathroom2",
                             "staircase",  "veach-ajar", "living-room", "kitchen"};

std::string render(const std::string& name) {
  return FATHOM_SHARED "/renders/" + name;
}

// relMSE, the reference's own error subtracted.
struct Errors {
  double flat = 0, bins = 0, front = 0, behind = 0;
  double cut = 0;  // summed over both sides of the plane, of the pixels that have alpha on both
};

class Frame {
 public:
  explicit Frame(const std::string& name)
      : noisy(read(render(name + ".deep.exr"))),
        bins_(read(render(name + ".deepref.exr"))),
        reference_(flat::read(render(name + ".ref.exr"))),
        median_(medianDepth(bins_)) {
    addOwnVariance(noisy, bins_);
    std::vector<std::string> names;
    for (const Channel& channel : noisy.channels) names.push_back(channel.name);
    plan = {findDenoiseInputs(names, noisy.attributes), {}, meanLevel(noisy)};
    guidedPlan = plan;
    guidedPlan.guided = true;
  }

  double flatError(const flat::Image& image) const {
    return flat::compare(image, reference_, {.correct = true}).relMse;
  }

  Errors errorsOf(const DeepImage& image) const {
    const DeepMetrics metrics = compare(image, bins_, {.correct = true, .clips = {median_}});
    Errors errors{flatError(flatten(image)), metrics.bins.relMse, metrics.clips[0].front->relMse,
                  metrics.clips[0].behind->relMse};
    errors.cut = cutError(image);
    return errors;
  }

  BaseGuide guideOf(const GuideDenoisers& denoisers) const {
    return makeGuide(guideInput(noisy, plan, bool(denoisers.bins)), denoisers, plan);
  }
  DeepImage guided(const BaseGuide& guide) const { return denoise(noisy.copy(), guidedPlan, {}, nullptr, &guide); }

  DeepImage noisy;
  DenoisePlan plan, guidedPlan;

 private:
  double cutError(const DeepImage& image) const {
    constexpr float kFar = std::numeric_limits<float>::infinity();
    const std::array<std::pair<float, float>, 2> sides{{{-kFar, median_}, {median_, kFar}}};
    std::array<flat::Image, 2> found, expected;
    for (size_t s = 0; s < 2; ++s) {
      found[s] = visiblePart(image, sides[s].first, sides[s].second);
      expected[s] = visiblePart(bins_, sides[s].first, sides[s].second);
    }
    double sum = 0;
    for (size_t i = 0; i < image.pixels(); ++i) {
      if (!(expected[0].get("A").values[i] > 0) || !(expected[1].get("A").values[i] > 0)) continue;
      for (size_t s = 0; s < 2; ++s)
        for (const char* name : {"R", "G", "B"}) {
          const double r = double(expected[s].get(name).values[i]), e = double(found[s].get(name).values[i]) - r;
          sum += e * e / (r * r + 0.01);
        }
    }
    return sum;
  }

  DeepImage bins_;
  flat::Image reference_;
  float median_;
};

double meanOf(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / double(values.size());
}

TEST(GuideAccuracy, OurOwnFilterMakesTheFrameAsGoodAsAFlatOne) {
  std::vector<double> flatRatios, binRatios, cutRatios;
  for (const char* name : kFrames) {
    SCOPED_TRACE(name);
    const Frame frame(name);
    const flat::Image file = flat::read(render(name + std::string(".flat.exr")));
    const double flat = frame.flatError(flatNlMeans(planFlat(file, {}))(file, {}));
    const Errors alone = frame.errorsOf(denoise(frame.noisy.copy(), frame.plan));
    const Errors guided =
        frame.errorsOf(frame.guided(frame.guideOf({flatNlMeans(planFlattened(frame.plan)), {}, kOwnGuide})));
    EXPECT_LT(guided.flat, 1.02 * flat);
    EXPECT_LT(guided.bins, 1.03 * alone.bins);
    EXPECT_LT(guided.cut, 1.05 * alone.cut);
    flatRatios.push_back(guided.flat / flat);
    binRatios.push_back(guided.bins / alone.bins);
    cutRatios.push_back(guided.cut / alone.cut);
  }
  EXPECT_LT(meanOf(flatRatios), 0.95);
  EXPECT_LT(meanOf(binRatios), 1.0);
  RecordProperty("flat", std::to_string(meanOf(flatRatios)));
}

class WithOidnGuideAccuracy : public reference::WithOidnInstalled {};

TEST_F(WithOidnGuideAccuracy, BinsAndFrameAreBetterThanEither) {
  const auto library = flat::loadOidn(reference::kOidn);
  const flat::Denoiser prefiltered = flat::oidn(library, {}), plain = flat::oidn(library, {.prefilterGuides = false});
  std::vector<double> flatRatios, binRatios;
  for (const char* name : kFrames) {
    SCOPED_TRACE(name);
    const Frame frame(name);
    const BaseGuide guide = frame.guideOf({prefiltered, plain, {}});
    const flat::Image file = flat::read(render(name + std::string(".flat.exr")));
    const double oidn = frame.flatError(prefiltered(file, {}));
    const Errors noisy = frame.errorsOf(frame.noisy), alone = frame.errorsOf(denoise(frame.noisy.copy(), frame.plan));
    const Errors guided = frame.errorsOf(frame.guided(guide));
    EXPECT_LT(guided.flat, 1.05 * oidn);
    EXPECT_LT(guided.cut, 1.05 * alone.cut);
    for (const double Errors::*part : {&Errors::bins, &Errors::front, &Errors::behind}) {
      EXPECT_LT(guided.*part, 0.95 * (alone.*part));
      EXPECT_LT(guided.*part, noisy.*part);
      binRatios.push_back(guided.*part / (alone.*part));
    }
    flatRatios.push_back(guided.flat / oidn);
  }
  EXPECT_LT(meanOf(flatRatios), 0.95);
  EXPECT_LT(meanOf(binRatios), 0.75);
}

// The flat frame that bins come to is the one that the renderer wrote from the same camera samples.
TEST(GuideAccuracy, FlattenedNoiseIsThatOfTheFlatRender) {
  for (const char* name : kFrames) {
    SCOPED_TRACE(name);
    const Frame frame(name);
    const flat::Image made = flattenNoisy(frame.noisy, frame.plan.inputs);
    const flat::Image file = flat::read(render(name + std::string(".flat.exr")));
    for (const char* channel :
         {"R", "diffuse.G", "specular.B", "albedo.R", "N.Z", "half0.diffuse.R", "half1.specular.G", "half0.albedo.B"}) {
      double difference = 0, all = 0;
      for (size_t i = 0; i < made.dataWindow.area(); ++i) {
        difference += std::abs(double(made.get(channel).values[i] - file.get(channel).values[i]));
        all += std::abs(double(file.get(channel).values[i]));
      }
      EXPECT_LT(difference, 0.003 * all) << channel;
    }
    for (const char* channel : {"variance.R", "variance.B", "variance.albedo.G", "variance.N.X"}) {
      double difference = 0, all = 0;
      for (size_t i = 0; i < made.dataWindow.area(); ++i) {
        difference += std::abs(double(made.get(channel).values[i] - file.get(channel).values[i]));
        all += double(file.get(channel).values[i]);
      }
      EXPECT_LT(difference, 0.02 * all) << channel;
    }
  }
}

}  // namespace
}  // namespace fathom::deep
