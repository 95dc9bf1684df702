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

// Whoever takes the light from the albedo, noise and all.
TEST_F(ErrorEstimateOfDeep, WhatTheAlbedoHandsOnIsNoiseAsWell) {
  DeepImage noisy = frame.noisy.copy();
  for (const std::string half : {"", "half0.", "half1."})
    for (const std::string c : {"R", "G", "B"})
      std::ranges::copy(std::as_const(noisy).get(half + c), noisy.get(half + "albedo." + c).begin());
  for (const std::string c : {"R", "G", "B"})
    std::ranges::copy(std::as_const(noisy).get("variance." + c), noisy.get("variance.albedo." + c).begin());
  const auto albedo = [](DeepImage image, const Progress&) {
    for (const std::string c : {"R", "G", "B"})
      std::ranges::copy(std::as_const(image).get("albedo." + c), image.get(c).begin());
    return image;
  };
  EXPECT_NEAR(estimate(noisy, albedo) / noise(noisy), 1, 0.1);
}

// Two bins of half a pixel each, by 16 camera samples, without noise of their own. Which is seen how often is noise, of the
// result as of the render: where that is all, an estimate is at least half of it. The denoiser exchanges the bins' colours,
// and the rest of the estimate is below 0.
TEST(ErrorEstimateOfAlphas, IsAtLeastHalfOfTheirSpreadInTheResult) {
  DeepImage noisy{{0, 0, 20, 12}, {0, 0, 20, 12}, Buffer<uint64_t>(241), {}, {}};
  for (size_t i = 0; i <= 240; ++i) noisy.offsets[i] = 2 * i;
  const auto fill = [&](const std::string& name, float front, float back) {
    Buffer<float>& values = noisy.add(name, PixelType::Float).values;
    for (size_t i = 0; i < values.size(); ++i) values[i] = i % 2 ? back : front;
  };
  for (const std::string c : {"R", "G", "B"}) fill(c, 0.5f, 0), fill("variance." + c, 0, 0);
  fill("A", 0.5f, 1);
  fill("Z", 1, 2);
  fill("samples", 8, 8);
  std::vector<std::string> names;
  for (const Channel& channel : noisy.channels) names.push_back(channel.name);
  const auto exchange = [](DeepImage image, const Progress&) {
    for (const char* c : {"R", "G", "B"})
      for (size_t b = 0; b < image.samples(); ++b) image.get(c)[b] = b % 2 ? 1.0f : 0.0f;
    return image;
  };
  DeepImage denoised = exchange(noisy.copy(), {});
  addFlattenedErrors(noisy, findDenoiseInputs(names, {}), exchange, {.probes = 2}, {}, denoised);
  const double spread = (0.5 * 1 * 1 - 0.5 * 0.5) / 16;
  const flat::Image flat = flatten(denoised);
  for (const char* name : {"error.R", "error.G", "error.B"})
    for (const float v : flat.get(name).values) {
      EXPECT_GE(v, spread / 2 * (1 - 1e-5));
      EXPECT_LE(v, spread * (1 + 1e-5));
    }
}

TEST_F(ErrorEstimateOfDeep, WhatHidesNothingHasNoError) {
  DeepImage noisy = frame.noisy.copy();
  for (size_t b = 0; b < noisy.samples(); b += b < 100 ? 1 : 7) noisy.get("A")[b] = b % 2 ? 0 : std::nanf("");
  DeepImage denoised = noisy.copy();
  const auto same = [&](DeepImage image, const Progress&) {
    for (size_t b = 0; b < noisy.samples(); ++b)
      if (!(noisy.get("A")[b] > 0)) {
        EXPECT_EQ(image.get("diffuse.R")[b], noisy.get("diffuse.R")[b]) << "probes leave it as it is";
      }
    return image;
  };
  addFlattenedErrors(noisy, inputs, same, {.probes = 1}, {}, denoised);
  for (const char* name : {"error.R", "error.G", "error.B"})
    for (size_t b = 0; b < noisy.samples(); ++b) {
      const float error = denoised.get(name)[b];
      ASSERT_TRUE(error >= 0) << error;
      if (!(noisy.get("A")[b] > 0)) {
        ASSERT_EQ(error, 0);
      }
    }
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
