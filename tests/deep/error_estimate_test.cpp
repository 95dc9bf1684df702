// Estimated errors of denoised deep frames: what they are where the answer is known.
#include "deep/error_estimate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "deep/channels.h"
#include "deep/flat_noisy.h"
#include "deep/flatten.h"
#include "tests/reference/rendered_frame.h"

namespace fathom::deep {
namespace {

class ErrorEstimateOfDeep : public ::testing::Test {
 protected:
  const reference::RenderedFrame frame = reference::renderFrame({.width = 64, .height = 48});
  const DenoiseInputs inputs = [this] {
    std::vector<std::string> names;
    for (const Channel& channel : frame.noisy.channels) names.push_back(channel.name);
    return findDenoiseInputs(names, frame.noisy.attributes);
  }();

  // The sum of the estimates for what a denoiser makes of the frame.
  template <class Denoiser>
  double estimate(const Denoiser& denoiser) const {
    return estimate(frame.noisy, denoiser);
  }
  template <class Denoiser>
  double estimate(const DeepImage& noisy, const Denoiser& denoiser) const {
    DeepImage denoised = denoiser(noisy.copy(), Progress());
    addFlattenedErrors(noisy, inputs, denoiser, {.probes = 4}, {}, denoised);
    const flat::Image flat = flatten(denoised);
    double sum = 0;
    for (const char* name : {"error.R", "error.G", "error.B"})
      for (const float v : flat.get(name).values) {
        EXPECT_GE(v, 0);
        sum += double(v);
      }
    return sum;
  }
  double noise() const { return noise(frame.noisy); }
  double noise(const DeepImage& noisy) const {
    const flat::Image flat = flattenNoisy(noisy, inputs);
    double sum = 0;
    for (const char* name : {"variance.R", "variance.G", "variance.B"})
      for (const float v : flat.get(name).values) sum += double(v);
    return sum;
  }
};

TEST_F(ErrorEstimateOfDeep, WhoChangesNothingErrsByTheNoise) {
  const double error = estimate([](DeepImage image, const Progress&) { return image; });
  EXPECT_NEAR(error / noise(), 1, 0.1);
}

// What is half transparent tells its noise as well, and what is more than opaque is opaque.
TEST_F(ErrorEstimateOfDeep, WhateverTheLastAlphaIs) {
  const auto same = [](DeepImage image, const Progress&) { return image; };
  DeepImage thin = frame.noisy.copy(), thick = frame.noisy.copy();
  for (size_t b = 0; b < thin.samples(); ++b) {
    if (frame.noisy.get("A")[b] < 1) continue;
    for (Channel& channel : thin.channels) {
      const Role role = roleOf(channel);
      if (role == Role::Premultiplied || role == Role::Half || channel.name.ends_with("samples"))
        channel.values[b] *= 0.5f;
    }
    thin.get("A")[b] = 0.5f;
    thick.get("A")[b] = 1.5f;
  }
  EXPECT_NEAR(estimate(thin, same) / noise(thin), 1, 0.1);
  EXPECT_NEAR(estimate(thick, same) / estimate(same), 1, 1e-6);
}

TEST_F(ErrorEstimateOfDeep, WhoHalvesTheLightErrsByThat) {
  const auto half = [](DeepImage image, const Progress&) {
    for (const char* name : {"R", "G", "B"})
      for (float& v : image.get(name)) v *= 0.5f;
    return image;
  };
  double bias = 0;
  const flat::Image truth = flatten(frame.truth);
  for (const char* name : {"R", "G", "B"})
    for (const float v : truth.get(name).values) bias += 0.25 * double(v) * double(v);
  EXPECT_NEAR(estimate(half) / (bias + noise() / 4), 1, 0.1);
}

TEST_F(ErrorEstimateOfDeep, WhoKnowsTheBinsErrsByTheAlphas) {
  const auto knows = [this](DeepImage image, const Progress&) {
    for (const char* name : {"R", "G", "B"}) std::ranges::copy(frame.truth.get(name), image.get(name).begin());
    return image;
  };
  EXPECT_LT(estimate(knows), 0.4 * noise());
}

TEST_F(ErrorEstimateOfDeep, CanBeStopped) {
  std::stop_source source;
  source.request_stop();
  DeepImage denoised = frame.noisy.copy();
  const auto denoiser = [](DeepImage image, const Progress& progress) {
    progress.at(0.5);
    return image;
  };
  EXPECT_THROW(addFlattenedErrors(frame.noisy, inputs, denoiser, {}, {{}, source.get_token()}, denoised), Cancelled);
}

}  // namespace
}  // namespace fathom::deep
