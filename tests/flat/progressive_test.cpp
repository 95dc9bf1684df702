// The mix of render and denoised: its formulas, and that it is never far from the better of both.
#include "flat/progressive.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <span>

#include "base/error.h"
#include "flat/error_summary.h"
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

// A map and what else the mix takes of each pixel, all filled with different values.
struct MapOf {
  ErrorMap map;
  Buffer<float> k;

  explicit MapOf(size_t pixels) : k(pixels) {
    for (size_t c = 0; c < 3; ++c)
      for (auto* planes : {&map.error, &map.variance, &map.covariance}) (*planes)[c] = Buffer<float>(pixels);
    for (size_t i = 0; i < pixels; ++i) {
      k[i] = float(i % 4) / 4;
      for (size_t c = 0; c < 3; ++c) {
        map.error[c][i] = 1e-3f * float(i);
        map.variance[c][i] = 4e-3f * float(i % 6);
        map.covariance[c][i] = 1e-3f * float(i % 3);
      }
    }
  }
};

// Equations 9 and 8 with the departures of the header. `odds`: how many times as likely the denoised value is made.
void expectMix(const Image& noisy, const Noise& noise, const Image& denoised, const MapOf& of,
               const Buffer<float>& odds, const std::function<double(size_t)>& factor) {
  const Image result = mix(noisy, noise, denoised, of.map, of.k, odds);
  for (size_t i = 0; i < of.k.size(); ++i)
    for (size_t c = 0; c < 3; ++c) {
      const double e = double(of.map.error[c][i]), v = double(of.map.variance[c][i]),
                   f = double(of.map.covariance[c][i]);
      const double n = double(noise.samples[i]), doubt = n > 1 ? (n + 11) / (n - 1) : 1;
      const double s = doubt * std::max(v, double(noise.variance[c][i]));
      const double ours = factor(i) * std::max(s - f, 0.0), theirs = std::max(e - f, 0.0);
      const double a = std::min(theirs > 0 ? ours / (ours + theirs) : 1, 1 - double(of.k[i]) / doubt);
      const double x = double(noisy.get(kRgbNames[c]).values[i]), y = double(denoised.get(kRgbNames[c]).values[i]);
      EXPECT_NEAR(result.get(kRgbNames[c]).values[i], x + a * (y - x), 1e-5) << i;
      EXPECT_NEAR(result.get(std::string("error.") + kRgbNames[c]).values[i],
                  std::max(0.0, (1 - a) * (1 - a) * v + a * a * e + 2 * a * (1 - a) * f), 1e-6);
    }
}

TEST(Progressive, MixesByEquation9) {
  const NoisyFlat frame = makeNoisyFlat(7, 5, 1, 0.1f);
  const Image denoised = reference::boxMean(frame.noisy);
  MapOf of(35);
  const auto same = [](size_t) { return 1.0; };
  expectMix(frame.noisy, noiseOf(frame.noisy), denoised, of, {}, same);
  // Covariances larger than the variances and errors, less than nothing, and between both.
  for (size_t i = 0; i < 35; ++i) {
    of.map.covariance[0][i] = 0.1f;
    of.map.covariance[1][i] = -0.02f;
    of.map.covariance[2][i] = 0.025f;
  }
  expectMix(frame.noisy, noiseOf(frame.noisy), denoised, of, {}, same);
}

TEST(Progressive, FewSamplesAreDoubted) {
  NoisyFlat frame = makeNoisyFlat(7, 5, 1, 0.1f);
  const float counts[] = {0, 1, 1.25f, 1.5f, 2, 3, 8, 32, 1e6f};
  Buffer<float>& samples = frame.noisy.add("samples").values;
  for (size_t i = 0; i < 35; ++i) samples[i] = counts[i % 9];
  expectMix(frame.noisy, noiseOf(frame.noisy), reference::boxMean(frame.noisy), MapOf(35), {},
            [](size_t) { return 1.0; });
}

TEST(Progressive, OddsTiltTheShareUpToABound) {
  const NoisyFlat frame = makeNoisyFlat(7, 5, 1, 0.1f);
  Buffer<float> odds(35);
  for (size_t i = 0; i < 35; ++i) odds[i] = 0.25f * (float(i) - 17);
  expectMix(frame.noisy, noiseOf(frame.noisy), reference::boxMean(frame.noisy), MapOf(35), odds,
            [](size_t i) { return std::exp(std::clamp(0.25 * (double(i) - 17), -2.0, 2.0)); });
}

// Beside a render of 1e12 a difference would leave nothing of it.
TEST(Progressive, AllOfTheDenoisedValueIsThatValue) {
  NoisyFlat frame = makeNoisyFlat(4, 3, 1, 0.1f);
  const Image denoised = reference::boxMean(frame.noisy);
  for (const char* c : kRgbNames) frame.noisy.find(c)->values.fill(1e12f);
  MapOf of(12);
  of.k.fill(0);
  for (Buffer<float>& error : of.map.error) error.fill(0);
  const Image result = mix(frame.noisy, noiseOf(frame.noisy), denoised, of.map, of.k);
  for (size_t i = 0; i < 12; ++i) EXPECT_EQ(result.get("G").values[i], denoised.get("G").values[i]);
}

TEST(Progressive, WhatIsNotMixedHasTheErrorOfWhatStandsThere) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  NoisyFlat frame = makeNoisyFlat(4, 3, 1, 0.1f);
  Image denoised = reference::boxMean(frame.noisy);
  frame.noisy.find("R")->values[3] = nan;                                                         // the render, in R
  denoised.find("G")->values[5] = nan;                                                            // the denoiser, in G
  for (const char* c : kRgbNames) frame.noisy.find(std::string("variance.") + c)->values[7] = 0;  // converged
  const MapOf of(12);
  const Image result = mix(frame.noisy, noiseOf(frame.noisy), denoised, of.map, of.k);
  EXPECT_EQ(result.get("error.R").values[3], of.map.error[0][3]);
  EXPECT_EQ(result.get("error.G").values[3], of.map.error[1][3]);
  EXPECT_EQ(result.get("error.G").values[5], frame.noisy.get("variance.G").values[5]);
  EXPECT_EQ(result.get("error.G").values[7], 0);
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

Candidate flatCandidate(const Box& window, float value, float error) {
  Candidate candidate{{window, window, {}, {}}, {}, {}, {}};
  for (size_t c = 0; c < 3; ++c) {
    candidate.denoised.add(kRgbNames[c], value);
    candidate.map.error[c] = Buffer<float>(window.area(), error);
    candidate.map.variance[c] = Buffer<float>(window.area(), 1e6f);  // a render that does not count
    candidate.map.covariance[c] = Buffer<float>(window.area(), 0.0f);
    candidate.spread[c] = Buffer<float>(window.area(), error);
  }
  candidate.k = Buffer<float>(window.area(), 0.0f);
  return candidate;
}

TEST(Progressive, CandidatesWeighByTheirErrorsInAnyOrder) {
  const NoisyFlat frame = makeNoisyFlat(12, 8, 1, 0.5f);
  const Noise noise = noiseOf(frame.noisy);
  const Box& window = frame.noisy.dataWindow;
  std::vector<Candidate> some;
  some.push_back(flatCandidate(window, 0.4f, 0.01f));
  some.push_back(flatCandidate(window, 0.5f, 0.02f));
  some.push_back(flatCandidate(window, 0.6f, 0.04f));
  const Image one = mixCandidates(frame.noisy, noise, some);
  std::swap(some[0], some[2]);
  const Image other = mixCandidates(frame.noisy, noise, some);
  const double mean = (0.4 + 0.5 / 4 + 0.6 / 16) / (1 + 1.0 / 4 + 1.0 / 16);
  const Buffer<float> k = gate(frame.noisy, noise, [&] {
    Image image{window, window, {}, {}};
    for (const char* name : kRgbNames) image.add(name, float(mean));
    return image;
  }());
  for (size_t i = 0; i < window.area(); ++i) {
    ASSERT_NEAR(one.get("G").values[i], other.get("G").values[i], 1e-5);
    const double x = double(frame.noisy.get("G").values[i]),
                 doubt = double(noise.samples[i] + 11) / double(noise.samples[i] - 1);
    const double share = noise.samples[i] > 1 ? 1 - double(k[i]) / doubt : 1 - double(k[i]);
    ASSERT_NEAR(one.get("G").values[i], x + share * (mean - x), 2e-4) << i;
    // The mean error less the candidates' spread about their mean, which here is beyond what independent errors leave.
    const double error = (0.01 + 0.02 / 4 + 0.04 / 16) / (21.0 / 16),
                 square = (0.16 + 0.25 / 4 + 0.36 / 16) / (21.0 / 16);
    if (k[i] == 0) {
      ASSERT_NEAR(one.get("error.G").values[i], error - (square - mean * mean), 1e-4);
    }
  }
}

TEST(Progressive, ACandidateWithoutErrorIsTaken) {
  const NoisyFlat frame = makeNoisyFlat(12, 8, 1, 0.5f);
  const Noise noise = noiseOf(frame.noisy);
  std::vector<Candidate> some;
  some.push_back(flatCandidate(frame.noisy.dataWindow, 0.4f, 0));
  some[0].k = gate(frame.noisy, noise, some[0].denoised);
  const Image one = mixCandidates(frame.noisy, noise, some);
  some.push_back(flatCandidate(frame.noisy.dataWindow, 0.8f, 0.01f));
  const Image two = mixCandidates(frame.noisy, noise, some);
  for (size_t i = 0; i < 96; ++i) ASSERT_NEAR(two.get("G").values[i], one.get("G").values[i], 1e-5);
}

// The merged candidate: neither a render that does not count nor the gate changes it.
Image mixOf(const std::vector<std::pair<float, float>>& valuesAndErrors) {
  const NoisyFlat frame = makeNoisyFlat(12, 8, 1, 0.5f);
  std::vector<Candidate> some;
  for (const auto& [value, error] : valuesAndErrors)
    some.push_back(flatCandidate(frame.noisy.dataWindow, value, error));
  ProgressiveParams params;
  params.gate.threshold = 1e30f;
  return mixCandidates(frame.noisy, noiseOf(frame.noisy), some, params);
}

TEST(Progressive, TheLeastErrorsWeighToo) {
  const Image result = mixOf({{0.4f, 1e-24f}, {0.5f, 2e-24f}});
  for (const float v : result.get("G").values) EXPECT_NEAR(v, (0.4 + 0.5 / 4) / 1.25, 1e-6);
}

// Nothing apart, but for how squares are rounded: the error is that of the mean, and no less than if errors were independent.
TEST(Progressive, CandidatesThatAgreeHaveTheirMeanError) {
  const double w = 9.0 / 10, v = 1.0 / 10;
  for (int j = 0; j < 16; ++j) {
    const float value = 0.3f + 0.07f * float(j);
    const Image result = mixOf({{value, 1e-10f}, {value, 3e-10f}});
    for (const float error : result.get("error.G").values) {
      EXPECT_LE(error, 1.001 * (w * 1e-10 + v * 3e-10)) << value;
      EXPECT_GE(error, 0.999 * (w * w * 1e-10 + v * v * 3e-10)) << value;
    }
  }
}

// Farther apart than their errors, and so far that the distance is beyond what counts as a number.
TEST(Progressive, CandidatesThatDisagreeHaveTheErrorOfIndependentOnes) {
  const Image apart = mixOf({{0.2f, 0.01f}, {0.8f, 0.01f}}), far = mixOf({{1e10f, 0.01f}, {-1e10f, 0.01f}});
  for (const float error : apart.get("error.G").values) EXPECT_NEAR(error, 0.005, 1e-6);
  for (const float error : far.get("error.G").values) EXPECT_NEAR(error, 0.01, 1e-6);
}

TEST(Progressive, WithoutAFiniteCandidateTheRenderStays) {
  const NoisyFlat frame = makeNoisyFlat(12, 8, 1, 0.1f);
  std::vector<Candidate> some;
  for (int n = 0; n < 2; ++n) {
    some.push_back(flatCandidate(frame.noisy.dataWindow, 0.4f, 0.01f));
    some.back().denoised.find("G")->values.fill(std::numeric_limits<float>::quiet_NaN());
  }
  const Image result = mixCandidates(frame.noisy, noiseOf(frame.noisy), some);
  for (size_t i = 0; i < 96; ++i) {
    EXPECT_EQ(result.get("G").values[i], frame.noisy.get("G").values[i]);
    EXPECT_EQ(result.get("error.G").values[i], frame.noisy.get("variance.G").values[i]);
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

TEST(Progressive, ACandidateThatIsNotFiniteDoesNotCount) {
  const NoisyFlat frame = makeNoisyFlat(12, 8, 1, 0.1f);
  const Noise noise = noiseOf(frame.noisy);
  std::vector<Candidate> some;
  some.push_back(flatCandidate(frame.noisy.dataWindow, 0.4f, 0.01f));
  some.push_back(flatCandidate(frame.noisy.dataWindow, 0.4f, 0.01f));
  for (Candidate& candidate : some) candidate.k = gate(frame.noisy, noise, candidate.denoised);
  some[1].denoised.find("G")->values.fill(std::numeric_limits<float>::infinity());
  const Image two = mixCandidates(frame.noisy, noise, some);
  some.pop_back();
  const Image one = mixCandidates(frame.noisy, noise, some);
  for (const char* name : {"R", "G", "B"})
    for (size_t i = 0; i < 96; ++i) ASSERT_NEAR(two.get(name).values[i], one.get(name).values[i], 1e-5);
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

TEST(ErrorSummary, IsTheMeanOfRelativeErrorsByFrameAndTile) {
  Image image{{10, 20, 110, 90}, {0, 0, 200, 100}, {}, {}};
  for (const char* c : kRgbNames) {
    image.add(c, 0.3f);
    image.add(std::string("error.") + c, 0.001f);
    image.add(std::string("variance.") + c, 0.01f);
  }
  for (int y = 84; y < 90; ++y)
    for (int x = 74; x < 110; ++x)
      for (const char* c : kRgbNames)
        image.find(std::string("error.") + c)->values[image.dataWindow.index(x, y)] = 0.1f;
  image.find("R")->values[0] = std::numeric_limits<float>::quiet_NaN();
  const ErrorSummary summary = summarizeErrors(image, noiseOf(image));
  ASSERT_EQ(summary.tiles.size(), 4u);
  EXPECT_EQ(summary.tiles[3].window.x0, 74);
  EXPECT_EQ(summary.tiles[3].window.y1, 90);
  EXPECT_NEAR(summary.tiles[0].relMse, 0.01, 1e-7);
  EXPECT_NEAR(summary.tiles[3].relMse, 1, 1e-6);
  const double share = 36.0 * 6 / 7000;
  EXPECT_NEAR(summary.relMse, (1 - share) * 0.01 + share, 1e-4);
  EXPECT_NEAR(summary.render, 0.1, 1e-4);
}

// What is no number is passed over, whole tiles of it too.
TEST(ErrorSummary, StepsOverWhatIsNotFinite) {
  Image image{{0, 0, 128, 4}, {0, 0, 128, 4}, {}, {}};
  for (const char* c : kRgbNames) {
    image.add(c, 0.3f);
    image.add(std::string("variance.") + c, 0.01f);
    Buffer<float>& error = image.add(std::string("error.") + c, 0.001f).values;
    for (size_t i = 0; i < error.size(); ++i)
      if (i % 128 >= 64 || i == 5) error[i] = i % 2 ? std::numeric_limits<float>::quiet_NaN() : 1e20f;
  }
  const ErrorSummary summary = summarizeErrors(image, noiseOf(image));
  ASSERT_EQ(summary.tiles.size(), 2u);
  EXPECT_NEAR(summary.tiles[0].relMse, 0.01, 1e-7);
  EXPECT_EQ(summary.tiles[1].relMse, 0);
  EXPECT_NEAR(summary.relMse, 0.01, 1e-7);
  EXPECT_NEAR(summary.render, 0.1, 1e-6);
}

}  // namespace
}  // namespace fathom::flat
