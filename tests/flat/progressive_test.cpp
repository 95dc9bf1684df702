// The mix of render and denoised: its formulas, and that it is never far from the better of both.
#include "flat/progressive.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <span>

#include "base/error.h"
#include "tests/reference/mix_net.h"
#include "tests/reference/noisy_flat.h"

namespace fathom::flat {
namespace {

using reference::boxDenoiser;
using reference::makeNoisyFlat;
using reference::NoisyFlat;

double squaredError(const Image& image, const Image& truth) {
  double total = 0;
  for (const char* c : kRgbNames)
    for (size_t i = 0; i < truth.dataWindow.area(); ++i) {
      const double e = double(image.get(c).values[i]) - double(truth.get(c).values[i]);
      total += e * e;
    }
  return total / double(3 * truth.dataWindow.area());
}

// Means over 7x7 pixels, made darker: much less noise, and a bias that does not go away.
Denoiser biased(float damage) {
  return [damage](const Image& noisy, const Progress&) {
    Image result = reference::boxMean(reference::boxMean(reference::boxMean(noisy)));
    for (Plane& plane : result.planes)
      for (float& v : plane.values) v *= 1 - damage;
    return result;
  };
}

TEST(Progressive, IsNoWorseThanTheRenderNorTheDenoiser) {
  for (const float noise : {0.3f, 0.1f, 0.03f, 0.01f, 0.003f})
    for (const float damage : {0.0f, 0.02f, 0.1f, 0.5f}) {
      const NoisyFlat frame = makeNoisyFlat(48, 40, 1, noise);
      const Denoiser denoiser = biased(damage);
      const Image result = denoiseProgressively(frame.noisy, denoiser);
      const double mixed = squaredError(result, frame.truth);
      EXPECT_LT(mixed, 1.1 * squaredError(frame.noisy, frame.truth)) << noise << ", " << damage;
      EXPECT_LT(mixed, 1.1 * squaredError(denoiser(frame.noisy, {}), frame.truth)) << noise << ", " << damage;
    }
}

// The noise falls by 100 each time, the bias stays: so must the error fall.
TEST(Progressive, ConvergesToTheTruthWithADenoiserThatDoesNot) {
  double last = 1;
  for (const float noise : {0.3f, 0.03f, 0.003f, 0.0003f}) {
    const NoisyFlat frame = makeNoisyFlat(48, 40, 1, noise);
    const double error = squaredError(denoiseProgressively(frame.noisy, biased(0.1f)), frame.truth);
    EXPECT_LT(error, last / 4) << noise;
    last = error;
  }
  EXPECT_LT(last, 1.1 * 0.0003 * 0.0003);
}

std::shared_ptr<const nn::MixNet> randomNet(uint32_t seed, float factor = 1) {
  reference::PlainWeights weights = reference::randomMix(seed);
  for (const char* name : {"weight", "share"})
    for (float& v : weights.tensors.at(std::string(name) + ".weight").values) v *= factor;
  return std::make_shared<nn::MixNet>(nn::readWeights(reference::safetensors(weights), "random"));
}

// The law does not depend on what is learned: with several denoisers that are all wrong, and networks that say the
// most that they can for one or the other of them and against the render.
TEST(Progressive, ConvergesWhateverTheNetworkSays) {
  const Estimator estimators[] = {byProbes(biased(0.1f)), byProbes(biased(-0.2f)), byProbes(biased(0.3f))};
  for (const uint32_t seed : {1U, 2U, 3U})
    for (const float factor : {0.0f, 1.0f, -30.0f, 30.0f}) {
      const float noise = 0.0003f;
      const NoisyFlat frame = makeNoisyFlat(48, 40, 1, noise);
      ProgressiveParams params;
      params.net = randomNet(seed, factor);
      const double error = squaredError(denoiseProgressively(frame.noisy, estimators, params), frame.truth);
      EXPECT_LT(error, 1.1 * double(noise) * double(noise)) << seed << ", " << factor;
    }
}

// Nothing learned, nothing changed.
TEST(Progressive, ANetworkThatSaysNothingChangesNothing) {
  const NoisyFlat frame = makeNoisyFlat(33, 21, 1, 0.1f);
  const Estimator estimators[] = {byProbes(boxDenoiser()), byProbes(biased(0.2f))};
  reference::PlainWeights weights = reference::randomMix(4);
  for (const char* name : {"weight.weight", "weight.bias", "share.weight", "share.bias"})
    for (float& v : weights.tensors.at(name).values) v = 0;
  ProgressiveParams params;
  params.net = std::make_shared<nn::MixNet>(nn::readWeights(reference::safetensors(weights), "still"));
  for (const size_t count : {1U, 2U}) {
    const std::span some(estimators, count);
    const Image still = denoiseProgressively(frame.noisy, some, params), rule = denoiseProgressively(frame.noisy, some);
    for (const Plane& plane : rule.planes)
      for (size_t i = 0; i < plane.values.size(); ++i)
        ASSERT_EQ(still.get(plane.name).values[i], plane.values[i]) << plane.name;
    params.net = randomNet(4);
    const Image changed = denoiseProgressively(frame.noisy, some, params);
    EXPECT_FALSE(std::ranges::equal(changed.get("R").values, rule.get("R").values));
    params.net = std::make_shared<nn::MixNet>(nn::readWeights(reference::safetensors(weights), "still"));
  }
}

// What the network's mix lacks comes back, by the brightness of the frame, but not to what is converged.
TEST(Progressive, LightComesBackAtAnyExposure) {
  NoisyFlat frame = makeNoisyFlat(64, 48, 1, 0.2f);
  for (const char* c : kRgbNames)
    for (size_t i = 0; i < 640; ++i) frame.noisy.find(std::string("variance.") + c)->values[i] = 0;
  ProgressiveParams params;
  params.net = randomNet(1, 0);
  const Denoiser dark = [&](const Image& noisy, const Progress&) {
    Image result = reference::boxMean(noisy);
    for (Plane& plane : result.planes) {
      const Buffer<float>& truth = frame.truth.get(plane.name).values;
      const double scale = double(noisy.get(plane.name).values[0]) / double(frame.noisy.get(plane.name).values[0]);
      for (size_t i = 0; i < truth.size(); ++i) plane.values[i] = float(0.92 * scale * double(truth[i]));
    }
    return result;
  };
  const Estimator estimators[] = {byProbes(dark)};
  const auto mixed = [&](float scale) {
    Image noisy = frame.noisy.copy();
    for (Plane& plane : noisy.planes)
      if (!plane.name.ends_with("samples"))
        for (float& v : plane.values) v *= plane.name.starts_with("variance.") ? scale * scale : scale;
    return denoiseProgressively(noisy, estimators, params);
  };
  const Image result = mixed(1), dim = mixed(0x1p-24f);
  double light = 0, truth = 0;
  for (size_t i = 0; i < frame.truth.dataWindow.area(); ++i) {
    if (i < 640) {
      EXPECT_EQ(result.get("G").values[i], frame.noisy.get("G").values[i]);
    } else {
      light += double(result.get("G").values[i]);
      truth += double(frame.truth.get("G").values[i]);
    }
    ASSERT_NEAR(dim.get("G").values[i] * 0x1p24f, result.get("G").values[i], 1e-3);
  }
  EXPECT_NEAR(light / truth, 0.99, 0.01);
}

TEST(Progressive, ConvergedPixelsAreTheRenderItself) {
  NoisyFlat frame = makeNoisyFlat(16, 12, 1, 0.1f);
  for (const char* c : kRgbNames)
    for (size_t i = 0; i < 96; ++i) frame.noisy.find(std::string("variance.") + c)->values[i] = 0;
  const Image result = denoiseProgressively(frame.noisy, biased(0.5f));
  for (const char* c : kRgbNames)
    for (size_t i = 0; i < 96; ++i) {
      EXPECT_EQ(result.get(c).values[i], frame.noisy.get(c).values[i]);
      EXPECT_EQ(result.get(std::string("error.") + c).values[i], 0);
    }
}

TEST(Progressive, UnknownPixelsAreTheDenoisedValueAndNothingSpreads) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  NoisyFlat frame = makeNoisyFlat(16, 12, 1, 0.1f);
  frame.noisy.find("G")->values[40] = nan;
  // As a filter that steps over what is not finite.
  const Denoiser denoiser = [](const Image& noisy, const Progress& progress) {
    Image clean = noisy.copy();
    for (const char* c : kRgbNames)
      for (float& v : clean.find(c)->values) v = std::isfinite(v) ? v : 0.5f;
    return boxDenoiser()(clean, progress);
  };
  const Image result = denoiseProgressively(frame.noisy, denoiser);
  EXPECT_EQ(result.get("G").values[40], denoiser(frame.noisy, {}).get("G").values[40]);
  for (const Plane& plane : result.planes)
    for (const float v : plane.values) ASSERT_TRUE(std::isfinite(v)) << plane.name;
  // A denoiser that breaks everywhere leaves the render.
  const Denoiser broken = [&](const Image& noisy, const Progress&) {
    Image none = noisy.copy();
    for (const char* c : kRgbNames) none.find(c)->values.fill(nan);
    return none;
  };
  const Image kept = denoiseProgressively(frame.noisy, broken);
  for (size_t i = 0; i < 192; ++i) EXPECT_EQ(kept.get("R").values[i], frame.noisy.get("R").values[i]);
  EXPECT_EQ(kept.get("G").values[40], 0);
}

TEST(Progressive, TakesAnySizeAndNumberOfThreads) {
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(1, 9), std::pair(9, 1), std::pair(33, 21)}) {
    const NoisyFlat frame = makeNoisyFlat(width, height, 1, 0.1f);
    const Image many = denoiseProgressively(frame.noisy, boxDenoiser());
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const Image single = denoiseProgressively(frame.noisy, boxDenoiser());
    for (const Plane& plane : many.planes)
      for (size_t i = 0; i < plane.values.size(); ++i) ASSERT_EQ(plane.values[i], single.get(plane.name).values[i]);
  }
}

TEST(Progressive, ProgressNeverFallsAndEndsAtOne) {
  double last = 0;
  denoiseProgressively(makeNoisyFlat(9, 9, 1).noisy, boxDenoiser(), {},
                       {[&](double done) {
                          EXPECT_GE(done, last);
                          last = done;
                        },
                        {}});
  EXPECT_EQ(last, 1);
}

}  // namespace
}  // namespace fathom::flat
