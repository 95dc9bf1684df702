// NL-Means on flat frames: what their sample counts decide.
#include "deep/flat_nl_means.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "deep/flat_noisy.h"
#include "deep/one_bin.h"
#include "tests/reference/noisy_flat.h"
#include "tests/reference/rendered_frame.h"

namespace fathom::deep {
namespace {

using flat::kRgbNames;

std::vector<std::string> namesOf(const auto& planes) {
  std::vector<std::string> names;
  for (const auto& plane : planes) names.push_back(plane.name);
  return names;
}

bool same(const flat::Image& a, const flat::Image& b) {
  return std::ranges::all_of(
      kRgbNames, [&](const char* name) { return std::ranges::equal(a.get(name).values, b.get(name).values); });
}

TEST(FlatNlMeans, PlansForFlattenedFramesAreForWhatTheyOffer) {
  const DeepImage deep = reference::renderFrame({.width = 16, .height = 12}).noisy;
  DenoisePlan plan{findDenoiseInputs(namesOf(deep.channels), deep.attributes), {}, 0.5f, true};
  plan.inputs.volumes = true;
  ASSERT_TRUE(plan.inputs.halfCounts && plan.params.gate);
  const flat::Image flattened = flattenNoisy(deep, plan.inputs);
  const DenoiseInputs offered = findDenoiseInputs(namesOf(flattened.planes), deep.attributes);
  const DenoisePlan planned = planFlattened(plan);
  EXPECT_EQ(planned.inputs.counts, offered.counts);
  EXPECT_EQ(planned.inputs.halfCounts, offered.halfCounts);
  EXPECT_EQ(planned.inputs.halves, offered.halves);
  EXPECT_EQ(planned.inputs.components, offered.components);
  EXPECT_EQ(planned.inputs.volumes, offered.volumes);
  EXPECT_FALSE(planned.guided || planned.params.gate);
}

// The gate goes by them: a pixel of few samples is noisier than its variance of the mean lets its neighbours expect.
TEST(FlatNlMeans, SamplesPerPixelCount) {
  flat::Image frame = reference::makeNoisyFlat(40, 30, 1, 0.1f).noisy;
  std::erase_if(frame.planes, [](const flat::Plane& plane) { return plane.name.ends_with("samples"); });
  const auto denoised = [](const flat::Image& image) { return flatNlMeans(planFlat(image, {}))(image, {}); };
  const flat::Image by16 = denoised(frame);
  flat::Image counted = frame.copy();
  counted.add("samples", 16);
  EXPECT_TRUE(same(denoised(counted), by16)) << "fathom:spp is as good as a count of as many everywhere";
  for (size_t i = 0; i < 600; ++i) counted.find("samples")->values[i] = 2;
  EXPECT_FALSE(same(denoised(counted), by16));
  frame.attributes.erase("fathom:spp");
  counted.find("samples")->values.fill(64);
  EXPECT_TRUE(same(denoised(counted), denoised(frame))) << "64 are assumed";
}

// How many samples a frame of no variance is of decides whether it is known to be the truth.
TEST(FlatNlMeans, ErrorsGoByTheSamplesOfTheFrame) {
  const auto oneBin = [](float value) {
    flat::Image image{{0, 0, 14, 12}, {0, 0, 14, 12}, {}, {}};
    for (const char* name : kRgbNames) {
      image.add(name, value);
      image.add(std::string("variance.") + name, 0);
    }
    DeepImage bins = fromFlat(image);
    makeOneBin(bins);
    return bins;
  };
  const DeepImage noisy = oneBin(0.5f);
  for (const auto& [spp, expected] : {std::pair(0, 0.04), {16, 0.04}, {3, 0.01}}) {
    DeepImage denoised = oneBin(0.7f);
    DenoiseInputs inputs = findDenoiseInputs(namesOf(noisy.channels), noisy.attributes);
    inputs.spp = spp;
    flat::NoiseResponse response;
    for (size_t c = 0; c < 3; ++c) {
      response.covariance[c] = Buffer<float>(noisy.pixels(), 0.0f);
      response.spread[c] = Buffer<float>(noisy.pixels(), 0.01f);
    }
    addErrors(noisy, inputs, std::move(response), denoised);
    for (const float v : denoised.get("error.G")) EXPECT_NEAR(v, expected, 1e-5) << spp;
  }
}

}  // namespace
}  // namespace fathom::deep
