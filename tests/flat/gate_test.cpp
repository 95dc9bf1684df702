// The gate on pixels against its twin, and what it is for. The decision's kernel is swept by tests/deep/gate_test.
#include "flat/gate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "flat/gate_kernel.h"
#include "tests/reference/flat_gate.h"
#include "tests/reference/noisy_flat.h"
#include "tests/reference/simd_targets.h"

namespace fathom::flat {
namespace {

using reference::makeNoisyFlat;
using reference::NoisyFlat;

// The truth made darker by `damage`.
Image damaged(const NoisyFlat& frame, float damage) {
  Image image = frame.truth.copy();
  for (Plane& plane : image.planes)
    for (float& v : plane.values) v *= 1 - damage;
  return image;
}

double mean(const Buffer<float>& k) {
  double sum = 0;
  for (const float v : k) sum += double(v);
  return sum / double(k.size());
}

TEST(FlatGate, EqualsItsTwin) {
  forSimdTargets([] {
    for (const auto& [width, height] : {std::pair(1, 1), std::pair(1, 9), std::pair(9, 1), std::pair(16, 11)})
      for (const float threshold : {2.0f, 2.5f}) {
        NoisyFlat frame = makeNoisyFlat(width, height, 1, 0.05f);
        Buffer<float>& samples = frame.noisy.add("samples", 16).values;
        for (size_t i = 0; i < samples.size(); ++i) samples[i] = float(2 + i % 5);
        const Image denoised = damaged(frame, 0.1f);
        const Noise noise = noiseOf(frame.noisy);
        const Buffer<float> k = gate(frame.noisy, noise, denoised, {threshold});
        for (int y = 0; y < height; ++y)
          for (int x = 0; x < width; ++x)
            ASSERT_NEAR(k[size_t(y * width + x)],
                        reference::gate(frame.noisy, noise, denoised, x, y, double(threshold)), 1e-4);
      }
  });
}

TEST(FlatGate, TakesBackDamageAndNotNoise) {
  const NoisyFlat frame = makeNoisyFlat(40, 30, 1, 0.02f);
  const Noise noise = noiseOf(frame.noisy);
  EXPECT_LT(mean(gate(frame.noisy, noise, frame.truth)), 0.02);
  EXPECT_GT(mean(gate(frame.noisy, noise, damaged(frame, 0.3f))), 0.9);
}

TEST(FlatGate, AValueThatIsNotFiniteHasNoSay) {
  const NoisyFlat frame = makeNoisyFlat(20, 10, 1, 0.05f);
  Noise noise = noiseOf(frame.noisy);
  Image denoised = damaged(frame, 0.3f);
  denoised.find("G")->values[4 * 20 + 9] = std::numeric_limits<float>::quiet_NaN();
  const Buffer<float> k = gate(frame.noisy, noise, denoised);
  noise.pixel[4 * 20 + 9] = PixelNoise::Unknown;
  const Buffer<float> expected = gate(frame.noisy, noise, damaged(frame, 0.3f));
  for (size_t i = 0; i < k.size(); ++i) ASSERT_EQ(k[i], expected[i]) << i;
}

TEST(FlatGate, TheKernelKnowsOfNothing) {
  GateNeighbours none;
  const GateSample here{{0.5f, 0.5f, 0.5f}, 4, {}, 0, {}, 0};
  EXPECT_EQ(takenBack(here, none, 2, 1e-4f).noise[0], 0);
  GateNeighbours itself;
  itself.add(here, 1);
  EXPECT_EQ(takenBack(here, itself, 2, 1e-4f).k, 0) << "neither noise nor bias";
}

TEST(FlatGate, GivesTheRenderWhereThereIsNoNoise) {
  const NoisyFlat frame = makeNoisyFlat(20, 10, 1, 0);
  const Image result = gated(frame.noisy, noiseOf(frame.noisy), damaged(frame, 0.3f));
  for (const char* c : kRgbNames)
    for (size_t i = 0; i < 200; ++i) EXPECT_NEAR(result.get(c).values[i], frame.noisy.get(c).values[i], 1e-6);
}

TEST(FlatGate, BehindADenoiserItMovesComponentsLikeTheirSum) {
  NoisyFlat frame = makeNoisyFlat(24, 20, 1, 0.02f);
  for (const char* c : kRgbNames)  // the noisy frame has the same two halves of its light
    for (const char* light : {"diffuse.", "specular."}) {
      Buffer<float>& values = frame.truth.add(std::string(light) + c).values;
      for (size_t i = 0; i < values.size(); ++i) values[i] = 0.5f * frame.truth.get(c).values[i];
    }
  const Denoiser bare = [&](const Image&, const Progress&) { return damaged(frame, 0.3f); };
  const Image result = withGate(bare)(frame.noisy, {}),
              expected = gated(frame.noisy, noiseOf(frame.noisy), bare({}, {}));
  const Image before = damaged(frame, 0.3f);
  double moved = 0;
  for (const char* c : kRgbNames)
    for (size_t i = 0; i < 480; ++i) {
      const float whole = result.get(c).values[i];
      EXPECT_EQ(whole, expected.get(c).values[i]);
      EXPECT_NEAR(result.get(std::string("diffuse.") + c).values[i], 0.5f * whole, 1e-5);
      EXPECT_NEAR(result.get(std::string("specular.") + c).values[i], 0.5f * whole, 1e-5);
      moved += double(std::abs(whole - before.get(c).values[i])) / 1440;
    }
  EXPECT_GT(moved, 0.05);
}

TEST(FlatGate, ComponentsThatAreNotFiniteAreNotTakenBack) {
  NoisyFlat frame = makeNoisyFlat(20, 10, 1, 0.02f);
  const Denoiser dark = [&](const Image&, const Progress&) {
    Image image = damaged(frame, 0.3f);
    image.add("diffuse.G", 0.25f);
    return image;
  };
  frame.noisy.find("diffuse.G")->values[77] = std::numeric_limits<float>::quiet_NaN();
  const Image result = withGate(dark)(frame.noisy, {});
  EXPECT_EQ(result.get("diffuse.G").values[77], 0.25f);
  EXPECT_NE(result.get("diffuse.G").values[78], 0.25f);
  EXPECT_GT(result.get("G").values[77], damaged(frame, 0.3f).get("G").values[77]);
}

TEST(FlatGate, BehindADenoiserItLeavesFramesThatSayNothingOfTheirNoise) {
  NoisyFlat frame = makeNoisyFlat(8, 6, 1, 0.02f);
  std::erase_if(frame.noisy.planes, [](const Plane& plane) { return plane.name.size() > 1; });
  ASSERT_FALSE(tellsNoise(frame.noisy));
  const Denoiser bare = [&](const Image&, const Progress&) { return damaged(frame, 0.3f); };
  const Image result = withGate(bare)(frame.noisy, {}), expected = bare({}, {});
  for (const char* c : kRgbNames)
    for (size_t i = 0; i < 48; ++i) EXPECT_EQ(result.get(c).values[i], expected.get(c).values[i]);
}

TEST(FlatGate, ScalesWithTheLight) {
  const NoisyFlat frame = makeNoisyFlat(20, 10, 1, 0.05f);
  NoisyFlat bright = makeNoisyFlat(20, 10, 1, 0.05f);
  for (Plane& plane : bright.noisy.planes)
    if (!plane.name.ends_with("samples"))
      for (float& v : plane.values) v *= plane.name.starts_with("variance.") ? 1024.0f * 1024 : 1024.0f;
  for (Plane& plane : bright.truth.planes)
    for (float& v : plane.values) v *= 1024;
  const Buffer<float> a = gate(frame.noisy, noiseOf(frame.noisy), damaged(frame, 0.1f)),
                      b = gate(bright.noisy, noiseOf(bright.noisy), damaged(bright, 0.1f));
  for (size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], 1e-5);
}

TEST(FlatGate, WhatIsNotKnownHasNoSay) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  NoisyFlat frame = makeNoisyFlat(12, 9, 1, 0.05f);
  const Image denoised = damaged(frame, 0.2f);
  frame.noisy.find("R")->values[50] = nan;
  Image broken = denoised.copy();
  broken.find("B")->values[30] = nan;
  const Image result = gated(frame.noisy, noiseOf(frame.noisy), broken);
  for (const char* c : kRgbNames)
    for (size_t i = 0; i < 108; ++i) {
      if (i == 30 && *c == 'B') continue;
      ASSERT_TRUE(std::isfinite(result.get(c).values[i])) << i;
    }
  EXPECT_EQ(result.get("R").values[50], denoised.get("R").values[50]);
}

}  // namespace
}  // namespace fathom::flat
