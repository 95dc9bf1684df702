// The gate against its twin, and what it is for: damage is taken back, noise is not.
#include "deep/gate.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/reference/gate.h"
#include "tests/reference/simd_targets.h"

namespace fathom::deep {
namespace {

// Bins of two surfaces and what is between them. Residuals are noise of variance per sample `noise` plus `damage` of
// the colour.
struct GateFrame {
  DenoiseData data;
  Buffer<uint64_t> offsets;
  Buffer<GateBin> bins;
  Buffer<uint8_t> still;

  GateFrame(int width, int height, unsigned mostBins, float noise, float damage, unsigned seed = 1) {
    std::mt19937 random(seed);
    const auto normal = [&] { return std::normal_distribution<float>(0, 1)(random); };
    const size_t pixels = size_t(width) * size_t(height);
    offsets = Buffer<uint64_t>(pixels + 1, 0);
    for (size_t p = 0; p < pixels; ++p) offsets[p + 1] = offsets[p] + random() % (mostBins + 1);
    data.width = width;
    data.height = height;
    data.offsets = offsets.data();
    bins = Buffer<GateBin>(offsets[pixels]);
    still = Buffer<uint8_t>(pixels, 0);
    Buffer<float>& depth = data.depth.value.emplace_back(bins.size());
    for (size_t b = 0; b < bins.size(); ++b) {
      depth[b] = float(1 + random() % 2) + 0.01f * normal();
      bins[b] = {};
      bins[b].samples = random() % 10 == 0 ? 0.0f : float(1 + random() % 32);
      for (size_t c = 0; c < 3; ++c) {
        bins[b].filtered[c] = 0.5f + 0.1f * normal();
        bins[b].variance[c] = noise;
        const float samples = std::max(1.0f, bins[b].samples);
        bins[b].residual[c] = damage * bins[b].filtered[c] + std::sqrt(noise / samples) * normal();
      }
    }
  }

  Buffer<float> run(float level = 0.5f) const {
    const Buffer<flat::GateVerdict> verdicts = gate(data, bins, still, level);
    Buffer<float> k(verdicts.size());
    for (size_t b = 0; b < k.size(); ++b) k[b] = verdicts[b].k;
    return k;
  }
};

void expectLikeTwin(const GateFrame& frame, float level = 0.5f) {
  const Buffer<float> k = frame.run(level);
  for (int y = 0; y < frame.data.height; ++y)
    for (int x = 0; x < frame.data.width; ++x) {
      const size_t p = size_t(y) * size_t(frame.data.width) + size_t(x);
      for (size_t b = frame.offsets[p]; b < frame.offsets[p + 1]; ++b)
        ASSERT_NEAR(k[b], reference::gate(frame.data, frame.bins, x, y, b, level), 1e-4) << x << ", " << y << ": " << b;
    }
}

TEST(Gate, EqualsItsTwin) {
  forSimdTargets([] {
    for (int width = 1; width <= 40; ++width) expectLikeTwin({width, 5, 1, 0.1f, 0.2f, unsigned(width)});
    for (const unsigned most : {2u, 5u, 40u}) expectLikeTwin({21, 17, most, 0.1f, 0.2f});
    for (const float noise : {0.0f, 1e-6f, 10.0f}) expectLikeTwin({21, 17, 2, noise, 0.05f});
    expectLikeTwin({21, 17, 2, 0.1f, 0.1f}, 1e-3f);
  });
}

TEST(Gate, BinsWithoutSamplesAreToldNothing) {
  const GateFrame frame(21, 17, 2, 0.1f, 0.2f);
  const Buffer<flat::GateVerdict> verdicts = gate(frame.data, frame.bins, frame.still, 0.5f);
  for (size_t b = 0; b < verdicts.size(); ++b)
    if (frame.bins[b].samples == 0) {
      ASSERT_EQ(verdicts[b].k, 0);
      ASSERT_EQ(verdicts[b].noise[0], 0);
    }
}

// A window with a bin in every pixel fills the last vector to its last lane.
TEST(Gate, EqualsItsTwinForFullWindows) {
  GateFrame frame(20, 20, 1, 0.1f, 0.2f);
  for (size_t p = 0; p < 400; ++p) frame.offsets[p + 1] = p + 1;
  frame.bins = Buffer<GateBin>(400);
  frame.data.depth.value[0] = Buffer<float>(400, 1.0f);
  for (size_t b = 0; b < 400; ++b)
    frame.bins[b] = {
        {0.5f, 0.4f, 0.3f + 0.001f * float(b)}, float(1 + b % 7), {0.1f, float(b % 5), 0}, 0, {0.1f, 0.2f, 0.3f}, 0};
  forSimdTargets([&] { expectLikeTwin(frame); });
}

double mean(const Buffer<float>& k, const GateFrame& frame) {
  double sum = 0, count = 0;
  for (size_t b = 0; b < k.size(); ++b) {
    if (!(frame.bins[b].samples > 0)) continue;
    sum += double(k[b]);
    ++count;
  }
  return sum / count;
}

TEST(Gate, TakesBackDamageAndNotNoise) {
  const GateFrame noise(40, 40, 2, 0.5f, 0), damage(40, 40, 2, 1e-4f, 0.2f);
  EXPECT_LT(mean(noise.run(), noise), 0.1);
  EXPECT_GT(mean(damage.run(), damage), 0.9);
}

TEST(Gate, PassesOverStillPixelsAndBinsWithoutSamples) {
  GateFrame frame(20, 20, 2, 1e-4f, 0.2f);
  const Buffer<float> before = frame.run();
  for (size_t p = 0; p < 400; p += 3) frame.still[p] = 1;
  const Buffer<float> after = frame.run();
  for (size_t p = 0; p < 400; ++p)
    for (size_t b = frame.offsets[p]; b < frame.offsets[p + 1]; ++b) {
      EXPECT_EQ(after[b], frame.still[p] ? 0 : before[b]);
      if (!(frame.bins[b].samples > 0)) {
        EXPECT_EQ(after[b], 0);
      }
    }
}

TEST(Gate, IsBetweenZeroAndOneForAnyFiniteValues) {
  GateFrame frame(20, 20, 2, 1e-4f, 0.2f);
  std::mt19937 random(1);
  const float odd[] = {0, 1e15f, -1e15f, 1e-30f, 3};
  for (size_t b = 0; b < frame.bins.size(); ++b)
    for (size_t c = 0; c < 3; ++c) {
      frame.bins[b].filtered[c] = odd[random() % 5];
      frame.bins[b].residual[c] = odd[random() % 5];
      frame.bins[b].variance[c] = std::fabs(odd[random() % 5]);
    }
  forSimdTargets([&] {
    for (const float k : frame.run()) ASSERT_TRUE(k >= 0 && k <= 1) << k;
  });
}

}  // namespace
}  // namespace fathom::deep
