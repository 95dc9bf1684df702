// What the deep denoiser reaches on renders, against what an independent slow implementation of the same methods
// measured (data/baselines.md); and that it takes the files of other programs.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>

#include "deep/compare.h"
#include "deep/denoise.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "deep/tidy.h"
#include "flat/io.h"

namespace fathom::deep {
namespace {

constexpr double kTolerance = 1.05;

std::string render(const std::string& name) {
  return FATHOM_SHARED "/renders/" + name;
}

DenoisePlan planFor(const DeepImage& image, const DenoiseParams& params) {
  std::vector<std::string> names;
  for (const Channel& channel : image.channels) names.push_back(channel.name);
  return {findDenoiseInputs(names, image.attributes), params, meanLevel(image)};
}

struct Baseline {
  const char* name;
  double flatPaper, flatGate;  // relMSE of the flattened result: deep R4 cross, gate
  double binsPaper, binsGate;  // relMSE per bin
};

class DenoiseAccuracy : public ::testing::TestWithParam<Baseline> {
 protected:
  const DeepImage noisy = read(render(GetParam().name + std::string(".deep.exr")));
  const DeepImage bins = read(render(GetParam().name + std::string(".deepref.exr")));
  const flat::Image reference = flat::read(render(GetParam().name + std::string(".ref.exr")));

  DeepImage denoised(const DenoiseParams& params) const { return denoise(noisy.copy(), planFor(noisy, params)); }
  double flatError(const DeepImage& image) const {
    return flat::compare(flatten(image), reference, {.correct = true}).relMse;
  }
  double binError(const DeepImage& image) const { return compare(image, bins).bins.relMse; }
};

TEST_P(DenoiseAccuracy, ReachesThePaperDoneRight) {
  const DeepImage out = denoised({.gate = false});
  EXPECT_LT(flatError(out), kTolerance * GetParam().flatPaper);
  EXPECT_LT(binError(out), kTolerance * GetParam().binsPaper);
}

TEST_P(DenoiseAccuracy, ReachesTheGateAndNeverHarmsBins) {
  const DeepImage out = denoised({});
  EXPECT_LT(flatError(out), kTolerance * GetParam().flatGate);
  EXPECT_LT(binError(out), kTolerance * GetParam().binsGate);
  EXPECT_LT(binError(out), binError(noisy));
  const float median = medianDepth(bins);
  const ClipMetrics before = compare(noisy, bins, {.clips = {median}}).clips[0];
  const ClipMetrics after = compare(out, bins, {.clips = {median}}).clips[0];
  EXPECT_LT(after.front->relMse, before.front->relMse);
  EXPECT_LT(after.behind->relMse, before.behind->relMse);
}

class DenoiseQuality : public DenoiseAccuracy {};

// On every frame within a tenth: what is best on average need not be best for fur.
TEST_P(DenoiseQuality, Pays) {
  const double fast = flatError(denoised({.quality = Quality::Fast})), balanced = flatError(denoised({}));
  const double best = flatError(denoised({.quality = Quality::Best}));
  EXPECT_LT(fast, flatError(noisy));
  EXPECT_LT(balanced, 1.1 * fast);
  EXPECT_LT(best, 1.1 * balanced);
}

TEST_P(DenoiseQuality, LessIsStillBetterThanNoise) {
  DeepImage image = noisy.copy();
  const auto keepOnly = [&](auto keep) {
    std::erase_if(image.channels, [&](const Channel& c) { return !keep(c.name); });
    const DeepImage out = denoise(image.copy(), planFor(image, {}));
    EXPECT_LT(flatError(out), flatError(noisy)) << image.channels.size();
    EXPECT_LT(binError(out), binError(noisy)) << image.channels.size();
  };
  keepOnly([](const std::string& name) { return !name.starts_with("half"); });
  // R G B A Z. Nothing but features tells hair from noise.
  if (GetParam().name != std::string("fur")) keepOnly([](const std::string& name) { return name.size() == 1; });
}

const Baseline kStaircase2{"staircase2", 0.00803, 0.00824, 0.01936, 0.01860};
const Baseline kFur{"fur", 0.01691, 0.01540, 0.08424, 0.04770};
const Baseline kKitchen{"kitchen", 0.01070, 0.01007, 0.12359, 0.02440};

std::string nameOf(const ::testing::TestParamInfo<Baseline>& test) {
  std::string name = test.param.name;
  std::erase(name, '-');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Renders, DenoiseAccuracy,
                         ::testing::Values(kStaircase2, kFur, kKitchen,
                                           Baseline{"coffee", 0.00294, 0.00301, 0.01070, 0.00810},
                                           Baseline{"bathroom2", 0.00469, 0.00460, 0.02174, 0.01260},
                                           Baseline{"staircase", 0.00280, 0.00255, 0.00544, 0.00480},
                                           Baseline{"veach-ajar", 0.01929, 0.01981, 0.04752, 0.04800},
                                           Baseline{"living-room", 0.01175, 0.01166, 0.03617, 0.02330}),
                         nameOf);
INSTANTIATE_TEST_SUITE_P(Renders, DenoiseQuality, ::testing::Values(kStaircase2, kFur, kKitchen), nameOf);

class DenoiseReal : public ::testing::TestWithParam<const char*> {};

TEST_P(DenoiseReal, GivesFiniteColoursAndTheSameBins) {
  DeepImage image = read(FATHOM_SHARED "/real/" + std::string(GetParam()));
  image = tidy(std::move(image)).image;
  for (const char* rgb : {"R", "G", "B"})
    if (!image.find(rgb)) image.add(rgb, PixelType::Float).values.fill(0.5f);  // files of alpha or ids alone
  for (const Quality quality : {Quality::Fast, Quality::Balanced, Quality::Best}) {
    const DeepImage out = denoise(image.copy(), planFor(image, {.quality = quality}));
    ASSERT_EQ(out.samples(), image.samples());
    EXPECT_EQ(std::memcmp(out.offsets.data(), image.offsets.data(), 8 * image.offsets.size()), 0);
    for (const Channel& before : image.channels) {
      const Channel* after = out.find(before.name);
      ASSERT_TRUE(after) << before.name;
      if (before.type != PixelType::Uint && before.name.size() == 1 && std::strchr("RGB", before.name[0])) {
        for (const float v : after->values) ASSERT_TRUE(std::isfinite(v)) << before.name;
        continue;
      }
      const void* a =
          before.type == PixelType::Uint ? static_cast<const void*>(before.ids.data()) : before.values.data();
      const void* b =
          after->type == PixelType::Uint ? static_cast<const void*>(after->ids.data()) : after->values.data();
      EXPECT_EQ(std::memcmp(a, b, 4 * image.samples()), 0) << before.name;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Files, DenoiseReal,
                         ::testing::Values("representativeDeepImage.exr", "deepalpha.exr", "ids-42.deep.exr",
                                           "Balls.exr", "Trunks.exr"),
                         [](const auto& test) {
                           std::string name = test.param;
                           for (char& c : name)
                             if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                           return name;
                         });

}  // namespace
}  // namespace fathom::deep
