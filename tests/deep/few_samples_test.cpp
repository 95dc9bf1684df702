// Frames of so few camera samples that most bins hold one, and no variance tells their noise.
#include <gtest/gtest.h>

#include <cmath>

#include "deep/denoise.h"
#include "deep/flatten.h"
#include "tests/reference/rendered_frame.h"

namespace fathom::deep {
namespace {

double flatError(const DeepImage& image, const DeepImage& truth) {
  const flat::Image a = flatten(image), b = flatten(truth);
  double sum = 0;
  for (const char* name : {"R", "G", "B"})
    for (size_t i = 0; i < truth.pixels(); ++i)
      sum += std::pow(double(a.get(name).values[i] - b.get(name).values[i]), 2);
  return sum;
}

// The gate does not take the noise of single samples for damage.
TEST(FewSamples, TheGateLeavesNoNoise) {
  for (const int spp : {2, 4}) {
    const reference::RenderedFrame frame = reference::renderFrame({.width = 64, .height = 48, .spp = spp});
    std::vector<std::string> names;
    for (const Channel& channel : frame.noisy.channels) names.push_back(channel.name);
    DenoisePlan plan{findDenoiseInputs(names, frame.noisy.attributes), {}, meanLevel(frame.noisy)};
    const double gated = flatError(denoise(frame.noisy.copy(), plan), frame.truth);
    plan.params.gate = false;
    const double filtered = flatError(denoise(frame.noisy.copy(), plan), frame.truth);
    EXPECT_LT(gated, 1.15 * filtered) << spp;
    EXPECT_LT(gated, 0.5 * flatError(frame.noisy, frame.truth)) << spp;
  }
}

}  // namespace
}  // namespace fathom::deep
