#include "flat/light.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace fathom::flat {
namespace {

struct Frame {
  std::array<std::vector<float>, 3> render, denoised;
  std::vector<uint8_t> settled;
  float level = 0.6f;

  explicit Frame(size_t pixels) : settled(pixels, 0) {
    for (size_t c = 0; c < 3; ++c) render[c].resize(pixels), denoised[c].resize(pixels);
  }

  Buffer<float> factors() const {
    return lightFactors({render[0], render[1], render[2]}, settled, {denoised[0], denoised[1], denoised[2]}, level);
  }
  // Of all that is not settled.
  double light(const Buffer<float>& factors) const {
    double sum = 0;
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < settled.size(); ++i)
        if (!settled[i]) sum += double(denoised[c][i]) * (factors.empty() ? 1 : double(factors[i]));
    return sum;
  }
  double given() const {
    double sum = 0;
    for (const auto& channel : render)
      for (const float v : channel) sum += double(v);
    return sum;
  }
};

// Brightness over ten octaves, skewed noise of the mean 0 and a denoised light that lacks `dark` of it.
Frame noisyFrame(unsigned seed, double dark, size_t pixels = 20000) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> octave(-8, 2);
  std::exponential_distribution<double> noise(1);
  Frame frame(pixels);
  for (size_t i = 0; i < pixels; ++i) {
    const double level = std::exp2(octave(random)), error = 0.3 * level * (noise(random) - 1);
    for (size_t c = 0; c < 3; ++c) {
      const double truth = level * (1 + 0.1 * double(c));
      frame.render[c][i] = float(truth + error);
      frame.denoised[c][i] = float(truth * (1 - dark));
    }
  }
  return frame;
}

// As the header has it, in double precision, by logarithms where the product goes by the bits of floats.
std::vector<double> plainFactors(const Frame& frame) {
  const size_t pixels = frame.settled.size();
  const auto mean = [](const auto& rgb, size_t i) {
    return (double(rgb[0][i]) + double(rgb[1][i]) + double(rgb[2][i])) / 3;
  };
  double all = 0, light = 0;
  const auto place = [&](size_t i, int& octave) {
    const double relative = mean(frame.denoised, i) / double(frame.level);
    octave = int(std::floor(std::log2(relative)));
    return relative / std::exp2(octave) - 1;
  };
  constexpr int kMiddle = 50;
  std::vector<double> count(100), d(100), n(100), v(100), lacking(100);
  for (size_t i = 0; i < pixels; ++i) {
    if (frame.settled[i] || !std::isfinite(mean(frame.render, i))) continue;
    int octave = 0;
    const double above = place(i, octave), x = mean(frame.denoised, i), y = mean(frame.render, i);
    for (const auto& [j, w] : {std::pair{octave, 1 - above}, {octave + 1, above}}) {
      count[size_t(j + kMiddle)] += w;
      d[size_t(j + kMiddle)] += w * x;
      n[size_t(j + kMiddle)] += w * y;
      v[size_t(j + kMiddle)] += w * w * (y - x) * (y - x);
    }
  }
  for (size_t j = 0; j < d.size(); ++j) {
    light += d[j];
    if (count[j] < 100) continue;
    const double e = n[j] / d[j] - 1, s2 = v[j] / (d[j] * d[j]);
    lacking[j] = std::clamp(e * std::max(0.0, 1 - 2 * s2 / (e * e)), -0.25, 0.25);
    all += lacking[j] * d[j];
  }
  double left = std::max(0.0, std::fabs(all) - 0.004 * light);
  for (size_t j = d.size(); j-- > 0;) {
    const double own = lacking[j] * d[j] * (all > 0 ? 1 : -1), taken = std::min(std::max(own, 0.0), left);
    lacking[j] *= own > 0 ? taken / own : 0;
    left -= taken;
  }
  std::vector<double> factors(pixels, 1);
  for (size_t i = 0; i < pixels; ++i) {
    if (frame.settled[i]) continue;
    int octave = 0;
    const double above = place(i, octave);
    factors[i] = 1 + (1 - above) * lacking[size_t(octave + kMiddle)] + above * lacking[size_t(octave + 1 + kMiddle)];
  }
  return factors;
}

TEST(Light, EqualsItsTwin) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    Frame frame = noisyFrame(seed, seed % 2 ? 0.04 : -0.06, 500 * seed * seed);
    for (size_t i = 0; i < frame.settled.size(); i += 7) frame.settled[i] = 1;
    for (size_t i = 3; i < frame.settled.size(); i += 50)
      frame.render[i % 3][i] = std::numeric_limits<float>::quiet_NaN();
    const std::vector<double> wanted = plainFactors(frame);
    const Buffer<float> factors = frame.factors();
    for (size_t i = 0; i < wanted.size(); ++i)
      ASSERT_NEAR(factors.empty() ? 1 : factors[i], wanted[i], 2e-6) << "pixel " << i << ", seed " << seed;
  }
}

TEST(Light, WhatIsLackingComesBack) {
  const Frame frame = noisyFrame(1, 0.05);
  const double lacked = frame.light({}) / frame.given() - 1, lacks = frame.light(frame.factors()) / frame.given() - 1;
  EXPECT_LT(lacked, -0.03);
  EXPECT_NEAR(lacks, -0.004, 0.003);
}

TEST(Light, TheBrightestGetTheirsFirst) {
  const Frame frame = noisyFrame(7, 0.05);
  const Buffer<float> factors = frame.factors();
  for (size_t i = 0; i < frame.settled.size(); ++i) {
    if (frame.denoised[0][i] > 2.5f) {
      EXPECT_GT(factors[i], 1.03f);
    }
    if (frame.denoised[0][i] < 0.01f) {
      EXPECT_EQ(factors[i], 1);
    }
  }
}

TEST(Light, OnlyTheBrightGetWhatOnlyTheyLack) {
  Frame frame = noisyFrame(2, 0);
  std::vector<bool> bright(frame.settled.size());
  for (size_t i = 0; i < bright.size(); ++i) {
    bright[i] = frame.denoised[0][i] > 1;
    for (size_t c = 0; bright[i] && c < 3; ++c) frame.denoised[c][i] *= 0.9f;
  }
  const Buffer<float> factors = frame.factors();
  ASSERT_FALSE(factors.empty());
  for (size_t i = 0; i < bright.size(); ++i) {
    if (bright[i] && frame.denoised[0][i] > 1.5f) {
      EXPECT_GT(factors[i], 1.05f);
    }
    if (frame.denoised[0][i] < 0.2f) {
      EXPECT_NEAR(factors[i], 1, 0.01f);
    }
  }
}

TEST(Light, NothingHappensWhereNothingIsKnownToLack) {
  EXPECT_TRUE(noisyFrame(3, 0).factors().empty());
  EXPECT_TRUE(Frame(0).factors().empty());
  EXPECT_TRUE(Frame(100).factors().empty());  // black
  Frame firefly = noisyFrame(4, 0);
  for (const float value : {1e3f, 1e6f, 1e12f, -1e5f, std::numeric_limits<float>::infinity()}) {
    firefly.render[1][500] = value;
    EXPECT_TRUE(firefly.factors().empty()) << value;
  }
}

TEST(Light, SettledPixelsStay) {
  Frame frame = noisyFrame(5, 0.08);
  for (size_t i = 0; i < frame.settled.size(); i += 3) {
    frame.settled[i] = 1;
    frame.render[0][i] = 1e4f;
  }
  const Buffer<float> factors = frame.factors();
  ASSERT_FALSE(factors.empty());
  size_t changed = 0;
  for (size_t i = 0; i < frame.settled.size(); ++i) {
    EXPECT_TRUE(factors[i] == 1 || !frame.settled[i]) << i;
    EXPECT_LT(factors[i], 1.15f);  // the settled ones' light would make it 1.25
    changed += factors[i] > 1.03f;
  }
  EXPECT_GT(changed, size_t(1000));
}

// One pixel says nothing of what the others lack, whatever its residual.
TEST(Light, AbsurdPixelsDoNotCount) {
  const Frame frame = noisyFrame(8, 0.05);
  const Buffer<float> wanted = frame.factors();
  for (const float value : {1e7f, -1e7f, 1e14f}) {
    Frame odd = frame;
    for (size_t c = 0; c < 3; ++c) odd.render[c][500] = value;
    const Buffer<float> factors = odd.factors();
    ASSERT_FALSE(factors.empty()) << value;
    for (size_t i = 0; i < wanted.size(); ++i) ASSERT_NEAR(factors[i], wanted[i], 2e-3f) << value << ", pixel " << i;
  }
}

// Both ways, by no more than a quarter; what is darker than all octaves goes by the last of them.
TEST(Light, FactorsEndAtAQuarterAndBelowTheOctaves) {
  for (const float level : {1.0f, 1e-9f})
    for (const float render : {0.5f, 0.9f, 1.1f, 3.0f}) {
      LightCurve curve(1);
      for (int i = 0; i < 1000; ++i) curve.add(level, level * (render + (i % 2 ? 0.01f : -0.01f)));
      curve.fit();
      const float expected = std::clamp(render, 0.75f, 1.25f);
      EXPECT_NEAR(curve.factor(level), expected, 0.006f) << level << ", " << render;  // but for the tolerance
      EXPECT_NEAR(curve.factor(1e-12f), level == 1 ? 1 : expected, 0.006f) << level << ", " << render;
      EXPECT_EQ(curve.factor(1e12f), 1);
    }
}

TEST(Light, LightThatComesBackIsStillFinite) {
  Image noisy{{0, 0, 20, 20}, {0, 0, 20, 20}, {}, {}}, denoised = noisy.copy();
  for (const char* c : {"R", "G", "B"}) {
    noisy.add(c, 9.9e14f);
    denoised.add(c, 8e14f);
    denoised.add(std::string("diffuse.") + c, 9.5e14f);
    denoised.add(std::string("specular.") + c, -9.5e14f);
  }
  keepLight(noisy, std::vector<uint8_t>(400, 0), denoised, 9e14f);
  EXPECT_GT(denoised.get("G").values[7], 9e14f);
  EXPECT_EQ(denoised.get("diffuse.G").values[7], 1e15f);
  EXPECT_EQ(denoised.get("specular.G").values[7], -1e15f);
}

TEST(Light, ScaledFramesAreTreatedAlike) {
  const Frame frame = noisyFrame(6, 0.05);
  const Buffer<float> wanted = frame.factors();
  for (const float scale : {1e-6f, 1e-3f, 0.125f, 7.0f, 1e6f}) {
    Frame scaled = frame;
    scaled.level *= scale;
    for (size_t c = 0; c < 3; ++c)
      for (auto* channel : {&scaled.render[c], &scaled.denoised[c]})
        for (float& v : *channel) v *= scale;
    const Buffer<float> factors = scaled.factors();
    for (size_t i = 0; i < wanted.size(); ++i) ASSERT_NEAR(factors[i], wanted[i], 1e-5f) << scale << ", pixel " << i;
  }
}

}  // namespace
}  // namespace fathom::flat
