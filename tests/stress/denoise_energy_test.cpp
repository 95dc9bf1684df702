// Denoisers move light about and make none: the light of a whole denoised frame is that of the reference within a hundredth, or
// within three standard errors of the render's own light and the reference's.
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>

#include "deep/base_guide.h"
#include "deep/denoise.h"
#include "deep/flat_nl_means.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "deep/layers.h"
#include "deep/layers_results.h"
#include "flat/finite.h"
#include "flat/io.h"
#include "flat/neural.h"
#include "flat/oidn.h"
#include "flat/progressive.h"
#include "tests/oidn/installed.h"
#include "tests/stress/extreme_noisy.h"
#include "tests/stress/record.h"

namespace fathom::deep {
namespace {

using stress::record;

std::string render(const std::string& name) {
  return FATHOM_SHARED "/renders/" + name;
}

std::string model(const std::string& name) {
  return FATHOM_DEMO "/../models/" + name + ".safetensors";
}

// The sum of R, G and B, and its standard error squared: the three share their noise.
struct Light {
  double sum = 0, variance = 0;
};

Light lightOf(const flat::Image& image, bool variances) {
  Light light;
  for (size_t i = 0; i < image.dataWindow.area(); ++i) {
    double deviation = 0;
    for (const char* c : flat::kRgbNames) {
      const float v = image.get(c).values[i];
      if (!isFinite(v)) continue;
      light.sum += double(v);
      if (variances) deviation += std::sqrt(double(std::max(0.0f, image.get(std::string("variance.") + c).values[i])));
    }
    light.variance += deviation * deviation;
  }
  return light;
}

class StressEnergyBase {
 protected:
  void look(const std::string& name) {
    if (!std::filesystem::exists(render(name + ".flat.exr"))) {
      skipped = true;
      return;
    }
    noisy = flat::read(render(name + ".flat.exr"));
    bins = read(render(name + ".deep.exr"));
    const flat::Image truth = flat::read(render(name + ".ref.exr"));
    const bool told = truth.find("variance.R");
    reference = lightOf(truth, told);
    const Light own = lightOf(noisy, true);
    frame = name;
    allowed = std::max(0.01 * reference.sum, 3 * std::sqrt(own.variance + reference.variance));
    record("light of " + frame, "the render: 1 is what is allowed", std::fabs(own.sum - reference.sum) / allowed, 1);
  }
  void expectLight(const std::string& method, const flat::Image& result) {
    const double sum = lightOf(result, false).sum, off = (sum - reference.sum) / allowed;
    record("light of " + frame, method + ": 1 is what is allowed", std::fabs(off), 1);
    EXPECT_LT(std::fabs(off), 1) << method << " on " << frame << ": " << 100 * (sum / reference.sum - 1)
                                 << " %, allowed " << 100 * allowed / reference.sum << " %";
  }

  bool skipped = false;
  std::string frame;
  flat::Image noisy;
  DeepImage bins;
  Light reference;
  double allowed = 0;
};

class StressEnergy : public StressEnergyBase, public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    look(GetParam());
    if (skipped) GTEST_SKIP() << "skipped: no " << render(GetParam());
  }
};

TEST_P(StressEnergy, OfOurFilters) {
  const auto run = [&](const DenoiseParams& params) {
    return flatten(denoise(bins.copy(), stress::planFor(bins, params)));
  };
  expectLight("own", run({}));
  expectLight("own, no gate", run({.gate = false}));
  expectLight("own, best", run({.quality = Quality::Best}));
  expectLight("paper", run({.filter = FilterKind::Paper}));
  expectLight("rdfc", run({.filter = FilterKind::Rdfc}));
  DenoisePlan plan = stress::planFor(bins);
  plan.guided = true;
  const BaseGuide guide =
      makeGuide(guideInput(bins, plan, false), {flatNlMeans(planFlattened(plan)), {}, kOwnGuide}, plan);
  expectLight("own, guided", flatten(denoise(bins.copy(), plan, {}, nullptr, &guide)));
  expectLight("flat own", flatNlMeans(planFlat(noisy, {}))(noisy, {}));
}

TEST_P(StressEnergy, OfNetworks) {
  const auto small = std::make_shared<const nn::CompositionalNet>(nn::readWeights(model("small")));
  const flat::Denoiser network = flat::neural(small, {});
  expectLight("network small", network(noisy, {}));
  expectLight("network small, gate", flat::withGate(network)(noisy, {}));
  const nn::CompositionalNet base(nn::readWeights(model("base")));
  expectLight("network base", flat::denoiseNeural(base, {.components = 1}, noisy));
  const flat::Estimator both[] = {nlMeansEstimator(planFlat(noisy, {.gate = false})),
                                  flat::byProbes(network, {.probes = 1})};
  expectLight("progressive, formula", flat::denoiseProgressively(noisy, both));
  flat::ProgressiveParams params;
  params.net = std::make_shared<const nn::MixNet>(nn::readWeights(model("mix")));
  expectLight("progressive, learned", flat::denoiseProgressively(noisy, both, params));
  const nn::LayersNet layers(nn::readWeights(model("layers")));
  const LayerSource source = layerSource(bins);
  denoiseLayers(layers, {}, source, measureLayers(source, {}), bins.dataWindow.y0, bins.dataWindow.y1,
                [&](const LayeredRows& rows) { expectLight("layered network, bins", flattenedLayers(rows)); });
}

constexpr const char* kFrames[] = {"staircase2", "fur",        "coffee",      "bathroom2",
                                   "staircase",  "veach-ajar", "living-room", "kitchen"};

std::string nameOf(const ::testing::TestParamInfo<const char*>& test) {
  std::string name = test.param;
  std::erase(name, '-');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Renders, StressEnergy, ::testing::ValuesIn(kFrames), nameOf);

// What the library itself does is not ours; with our gate behind it, it is.
class StressWithOidnEnergy : public StressEnergyBase, public reference::WithOidnInstalled {};

TEST_F(StressWithOidnEnergy, OfOpenImageDenoiseBehindTheGate) {
  const auto library = flat::loadOidn(reference::kOidn);
  for (const char* name : kFrames) {
    look(name);
    if (skipped) GTEST_SKIP() << "skipped: no " << render(name);
    expectLight("Open Image Denoise, gate", flat::withGate(flat::oidn(library, {.prefilterGuides = false}))(noisy, {}));
  }
}

}  // namespace
}  // namespace fathom::deep
