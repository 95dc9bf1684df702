// Several denoised images as one: their weights, and the error that is left.
#include <gtest/gtest.h>

#include <limits>
#include <utility>
#include <vector>

#include "flat/progressive.h"
#include "tests/reference/noisy_flat.h"

namespace fathom::flat {
namespace {

using reference::makeNoisyFlat;
using reference::NoisyFlat;

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

}  // namespace
}  // namespace fathom::flat
