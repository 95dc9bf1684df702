// How our own filter's result moves with the noise: unbiased where weights do not know what they average, and what the
// whole filter tells against truth and probes.
#include "deep/noise_response.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "deep/flat_nl_means.h"
#include "deep/one_bin.h"
#include "tests/reference/noisy_flat.h"

namespace fathom::deep {
namespace {

using flat::Image;
using flat::kRgbNames;
using reference::makeNoisyFlat;
using reference::NoisyFlat;

double sum(const std::array<Buffer<float>, 3>& planes) {
  double total = 0;
  for (const Buffer<float>& plane : planes)
    for (const float v : plane) total += double(v);
  return total;
}

double squaredError(const Image& image, const Image& truth) {
  double total = 0;
  for (const char* c : kRgbNames)
    for (size_t i = 0; i < image.dataWindow.area(); ++i) {
      const double e = double(image.get(c).values[i]) - double(truth.get(c).values[i]);
      total += e * e;
    }
  return total;
}

// A filter of halves whose weights are told by the other half alone: each pixel is mixed with the mean of its row's
// neighbours, the specular light not at all. `gate`: what is then taken back.
struct HandMade {
  Image denoised;
  flat::NoiseResponse response;

  HandMade(const Image& noisy, float gate) {
    DeepImage bins = fromFlat(noisy);
    makeOneBin(bins);
    std::vector<std::string> names;
    for (const Channel& channel : bins.channels) names.push_back(channel.name);
    const DenoiseInputs inputs = findDenoiseInputs(names, bins.attributes);
    const DenoiseData data = prepareColours(bins, inputs);
    const size_t pixels = bins.pixels();
    std::vector<HalfAnswer> answers;
    std::vector<Buffer<float>> filtered;
    for (size_t k = 0; k < data.components.size(); ++k) {
      const auto at = [&](size_t i, size_t h, size_t c) {
        const float* v = data.components[k].data.data() + 8 * i + 4 * h;
        return v[c] / v[3];
      };
      answers.emplace_back(pixels);
      filtered.emplace_back(3 * pixels, 0.0f);
      for (size_t i = 0; i < pixels; ++i) {
        const size_t left = (i + pixels - 1) % pixels, right = (i + 1) % pixels;
        for (size_t h = 0; h < 2; ++h) {
          const float s = k == 0 ? 0.35f + 0.3f * std::sin(5 * at(i, 1 - h, 0)) : 1;
          answers[k].share[h][i] = s;
          for (size_t c = 0; c < 3; ++c) {
            const float f = s * at(i, h, c) + 0.5f * (1 - s) * (at(left, h, c) + at(right, h, c));
            answers[k].difference[c][i] += h == 0 ? f : -f;
            filtered[k][3 * i + c] += 0.5f * f;
          }
        }
      }
    }
    Buffer<GateBin> gateBins(pixels);
    Buffer<flat::GateVerdict> gates(pixels, {gate, {}, {}});
    denoised = {noisy.dataWindow, noisy.displayWindow, {}, {}};
    for (size_t c = 0; c < 3; ++c) {
      Buffer<float>& values = denoised.add(kRgbNames[c]).values;
      for (size_t i = 0; i < pixels; ++i) {
        float f = 0;
        for (const Buffer<float>& part : filtered) f += part[3 * i + c];
        gateBins[i].residual[c] = noisy.get(kRgbNames[c]).values[i] - f;
        values[i] = f + gate * gateBins[i].residual[c];
      }
    }
    const Buffer<uint8_t> still(pixels, 0);
    const HalfDifferences differences = halfDifferences(bins, inputs, data);
    response = noiseResponse({bins, inputs, data, differences, answers, filtered, gateBins, gates, still});
  }
};

// What the two components of a frame have of the noise, which makeNoisyFlat gives in equal parts: here each has its own.
NoisyFlat withOwnNoise(unsigned seed, int n0, int n1) {
  NoisyFlat frame = makeNoisyFlat(24, 18, seed, 0.1f, n0, n1);
  const NoisyFlat other = makeNoisyFlat(24, 18, seed + 1000, 0.05f, n0, n1);
  for (const std::string half : {"", "half0.", "half1."})
    for (const std::string c : kRgbNames) {
      for (size_t i = 0; i < frame.truth.dataWindow.area(); ++i) {
        const float diffuse = frame.noisy.get(half + c).values[i], specular = other.noisy.get(half + c).values[i];
        frame.noisy.find(fmt::format("{}diffuse.{}", half, c))->values[i] = diffuse;
        frame.noisy.find(fmt::format("{}specular.{}", half, c))->values[i] = specular;
        frame.noisy.find(half + c)->values[i] = diffuse + specular;
      }
      if (!half.empty()) continue;
      for (float& v : frame.truth.find(c)->values) v *= 2;
      for (size_t i = 0; i < frame.truth.dataWindow.area(); ++i)
        frame.noisy.find("variance." + c)->values[i] += other.noisy.get("variance." + c).values[i];
    }
  return frame;
}

// The t statistic over seeds of estimate less truth, and that of what the covariance adds.
void expectUnbiased(int n0, int n1, float gate, bool variances) {
  constexpr int kSeeds = 60;
  double mean = 0, square = 0, covariance = 0, spread = 0;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    NoisyFlat frame = withOwnNoise(seed, n0, n1);
    if (!variances)
      std::erase_if(frame.noisy.planes, [](const flat::Plane& plane) { return plane.name.starts_with("variance."); });
    HandMade made(frame.noisy, gate);
    const flat::ErrorEstimate estimate =
        flat::estimateError(frame.noisy, flat::noiseOf(frame.noisy), made.denoised, std::move(made.response));
    const double d = sum(estimate.error) - squaredError(made.denoised, frame.truth);
    mean += d / kSeeds;
    square += d * d / kSeeds;
    covariance += 2 * sum(estimate.covariance) / kSeeds;
    spread += sum(estimate.spread) / kSeeds;
  }
  const double error = std::sqrt((square - mean * mean) / (kSeeds - 1));
  EXPECT_LT(std::abs(mean) / error, 3.5) << n0 << " " << n1 << " " << gate << " " << variances;
  EXPECT_GT(covariance / error, 10);  // so that the line above fails without it, and with twice as much
  EXPECT_GT(spread, 0);
}

TEST(NoiseResponse, EstimatesAreUnbiasedWhereWeightsDoNotKnowTheirHalf) {
  expectUnbiased(8, 8, 0, true);
  expectUnbiased(8, 8, 0, false);
  expectUnbiased(12, 4, 0, true);
  expectUnbiased(4, 12, 0, true);
}

TEST(NoiseResponse, TheGateGivesTheRendersNoiseBack) {
  expectUnbiased(8, 8, 0.4f, true);
  const NoisyFlat frame = withOwnNoise(1, 8, 8);
  const HandMade all(frame.noisy, 1);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < frame.noisy.dataWindow.area(); ++i) {
      const float s2 = frame.noisy.get(std::string("variance.") + kRgbNames[c]).values[i];
      ASSERT_NEAR(all.response.covariance[c][i], s2, 1e-6f);
      ASSERT_NEAR(all.response.spread[c][i], s2, 1e-6f);
    }
}

// Light that is divided by an albedo, which moves with it: where two surfaces share a pixel. The filter leaves light and
// albedo as they are, so that the result is the render and its covariance the variance.
TEST(NoiseResponse, TheAlbedoIsPartOfTheLight) {
  NoisyFlat frame = makeNoisyFlat(40, 30, 1);
  for (const std::string half : {"", "half0.", "half1."})
    for (const std::string c : kRgbNames) {
      Buffer<float>& albedo = frame.noisy.add(fmt::format("{}albedo.{}", half, c)).values;
      for (size_t i = 0; i < albedo.size(); ++i) {
        frame.noisy.find(fmt::format("{}specular.{}", half, c))->values[i] = 0;
        frame.noisy.find(fmt::format("{}diffuse.{}", half, c))->values[i] = frame.noisy.get(half + c).values[i];
        albedo[i] = std::max(0.0f, 0.8f * frame.noisy.get(half + c).values[i] - kAlbedoOffset);  // even light
      }
    }
  DeepImage bins = fromFlat(frame.noisy);
  makeOneBin(bins);
  std::vector<std::string> names;
  for (const Channel& channel : bins.channels) names.push_back(channel.name);
  const DenoiseInputs inputs = findDenoiseInputs(names, bins.attributes);
  ASSERT_TRUE(tellsResponse({inputs, {}}));
  DenoiseData data = prepareColours(bins, inputs);
  const Buffer<uint8_t> still(bins.pixels(), 0);
  prepareFeatures(bins, inputs, still, data);
  data.albedo.own = Buffer<float>(bins.pixels(), 1.0f);
  std::vector<HalfAnswer> answers;
  std::vector<Buffer<float>> filtered;
  for (const char* group : {"diffuse.", "specular."}) {
    HalfAnswer& answer = answers.emplace_back(bins.pixels());
    for (Buffer<float>& share : answer.share) share.fill(1);
    Buffer<float>& values = filtered.emplace_back(3 * bins.pixels());
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < bins.pixels(); ++i) values[3 * i + c] = bins.get(group + std::string(kRgbNames[c]))[i];
  }
  const flat::NoiseResponse response =
      noiseResponse({bins, inputs, data, halfDifferences(bins, inputs, data), answers, filtered,
                     Buffer<GateBin>(bins.pixels(), {}), Buffer<flat::GateVerdict>(bins.pixels(), {}), still});
  double variance = 0;
  for (const std::string c : kRgbNames)
    for (const float v : frame.noisy.get("variance." + c).values) variance += double(v);
  // All own: half of the sum of both halves' covariances, each the variance; the halves' difference is in the albedo.
  EXPECT_NEAR(sum(response.covariance) / variance, 1, 0.05);
}

// The whole filter: weights know a little of their half, by the noise that both halves share and the choice among
// candidates, so that the covariance is too small, here by an eighth (docs/notes.md).
TEST(NoiseResponse, OfTheFilterIsNearTheTruthAndItsProbes) {
  double told = 0, probed = 0, truth = 0, ofSpread = 0, spreadProbed = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const NoisyFlat frame = makeNoisyFlat(64, 48, seed);
    const DenoisePlan plan = planFlat(frame.noisy, {.gate = false});
    const FlatAnswer answer = answerNlMeans(frame.noisy, plan);
    const flat::Denoiser denoiser = flatNlMeans(plan);
    const flat::ErrorEstimate probes =
        estimateError(frame.noisy, flat::noiseOf(frame.noisy), answer.denoised, denoiser, {.seed = seed});
    told += sum(answer.response.covariance);
    ofSpread += sum(answer.response.spread);
    probed += sum(probes.covariance);
    spreadProbed += sum(probes.spread);
    for (const char* c : kRgbNames)
      for (size_t i = 0; i < frame.truth.dataWindow.area(); ++i)
        truth += (double(answer.denoised.get(c).values[i]) - double(frame.truth.get(c).values[i])) *
                 (double(frame.noisy.get(c).values[i]) - double(frame.truth.get(c).values[i]));
  }
  EXPECT_NEAR(told / truth, 0.88, 0.12);
  EXPECT_NEAR(told / probed, 0.88, 0.12);
  EXPECT_NEAR(std::log(ofSpread / spreadProbed), 0, std::log(1.6));
}

TEST(NoiseResponse, DoesNotChangeTheColours) {
  for (const Quality quality : {Quality::Fast, Quality::Balanced, Quality::Best}) {
    const NoisyFlat frame = makeNoisyFlat(45, 37, 1);
    const DenoisePlan plan = planFlat(frame.noisy, {.quality = quality});
    const Image plain = flatNlMeans(plan)(frame.noisy, {}), told = answerNlMeans(frame.noisy, plan).denoised;
    for (const char* c : kRgbNames)
      EXPECT_EQ(0, std::memcmp(plain.get(c).values.data(), told.get(c).values.data(), plain.dataWindow.area() * 4));
  }
}

TEST(NoiseResponse, IsTheSameForAnyThreadsAndBands) {
  const Image noisy = makeNoisyFlat(50, 130, 1).noisy;
  const DenoisePlan plan = planFlat(noisy, {.quality = Quality::Best});
  const FlatAnswer many = answerNlMeans(noisy, plan);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const FlatAnswer single = answerNlMeans(noisy, plan);
  const Box& box = noisy.dataWindow;
  const int halo = denoiseHalo(plan), y0 = box.y0 + 70, y1 = box.y1;
  ASSERT_GT(y0 - halo, box.y0);
  const Image rows = flat::crop(noisy, {box.x0, y0 - halo, box.x1, y1});
  const FlatAnswer band = answerNlMeans(rows, plan);
  const size_t width = size_t(box.width()), skip = size_t(y0 - box.y0) * width, skipBand = size_t(halo) * width;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < box.area(); ++i) {
      ASSERT_EQ(many.response.covariance[c][i], single.response.covariance[c][i]);
      ASSERT_EQ(many.response.spread[c][i], single.response.spread[c][i]);
      if (i < skip) continue;
      ASSERT_EQ(many.response.covariance[c][i], band.response.covariance[c][i - skip + skipBand]) << i;
      ASSERT_EQ(many.response.spread[c][i], band.response.spread[c][i - skip + skipBand]) << i;
    }
}

// Nothing noisy, and nothing at all: as probes have it. One pixel that is not finite spreads nowhere.
TEST(NoiseResponse, StillDarkAndOddPixels) {
  NoisyFlat frame = makeNoisyFlat(96, 40, 1);
  for (flat::Plane& plane : frame.noisy.planes) {
    if (plane.name.ends_with("samples")) continue;
    const bool variance = plane.name.starts_with("variance.");
    for (size_t i = 0; i < plane.values.size(); ++i) {
      const size_t x = i % 96;
      if (x < 32) plane.values[i] = variance ? 0 : 0.25f;
      if (x >= 64) plane.values[i] = 0;
      if (i == 20 * 96 + 48) plane.values[i] = std::numeric_limits<float>::quiet_NaN();
    }
  }
  const DenoisePlan plan = planFlat(frame.noisy, {});
  FlatAnswer answer = answerNlMeans(frame.noisy, plan);
  const flat::Noise noise = flat::noiseOf(frame.noisy);
  const flat::ErrorEstimate probes =
      estimateError(frame.noisy, noise, answer.denoised, flatNlMeans(plan), {.probes = 1});
  const flat::ErrorEstimate told = estimateError(frame.noisy, noise, answer.denoised, std::move(answer.response));
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < frame.noisy.dataWindow.area(); ++i) {
      ASSERT_TRUE(std::isfinite(told.error[c][i]) && std::isfinite(told.spread[c][i])) << i;
      const size_t x = i % 96;
      if (x >= 32 && x < 64) continue;
      ASSERT_EQ(told.covariance[c][i], probes.covariance[c][i]) << i;
      ASSERT_EQ(told.error[c][i], probes.error[c][i]) << i;
      if (x < 16 || x > 80) {
        ASSERT_EQ(told.error[c][i], 0);
        ASSERT_EQ(told.spread[c][i], 0);
      }
    }
  const size_t odd = 20 * 96 + 48;
  EXPECT_EQ(told.error[0][odd], told.spread[0][odd]);
  EXPECT_EQ(told.covariance[0][odd], 0);
}

TEST(NoiseResponse, NeedsHalves) {
  DenoiseInputs inputs;
  inputs.variance = true;
  EXPECT_FALSE(tellsResponse({inputs, {}}));
  inputs.halves = true;
  EXPECT_TRUE(tellsResponse({inputs, {}}));
  inputs.albedo = true;
  EXPECT_TRUE(tellsResponse({inputs, {}}));
  inputs.components = true;  // of which one is divided by the albedo
  EXPECT_FALSE(tellsResponse({inputs, {}}));
  inputs.albedoHalves = true;
  EXPECT_TRUE(tellsResponse({inputs, {}}));
}

}  // namespace
}  // namespace fathom::deep
