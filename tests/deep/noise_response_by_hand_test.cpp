// How a result moves with the noise, by hand: pixels of halves that are known.
#include <gtest/gtest.h>

#include <cmath>

#include "deep/noise_response.h"

namespace fathom::deep {
namespace {

// Pixels one below the other, of the halves `a` and `b` by their parts 3/4 and 1/4, whose light differs by `apart`.
struct ByHand {
  DeepImage image{{0, 0, 1, 1}, {0, 0, 1, 1}, {}, {}, {}};
  DenoiseInputs inputs{.halves = true};
  DenoiseData data;
  HalfDifferences differences;
  std::vector<HalfAnswer> answers;
  std::vector<Buffer<float>> filtered;
  Buffer<GateBin> bins;
  Buffer<flat::GateVerdict> gates;
  Buffer<uint8_t> still;

  ByHand(const std::vector<std::array<float, 3>>& pixels) {
    const size_t count = pixels.size();
    data.width = 1, data.height = int(count);
    data.components.push_back({"", false, Buffer<float>(8 * count), {}});
    for (Buffer<float>& plane : differences.light) plane = Buffer<float>(count);
    for (size_t i = 0; i < count; ++i) {
      const auto [a, b, apart] = pixels[i];
      for (size_t c = 0; c < 8; ++c)
        data.components[0].data[8 * i + c] = (c < 4 ? 0.75f : 0.25f) * (c % 4 == 3 ? 1 : c < 4 ? a : b);
      for (Buffer<float>& plane : differences.light) plane[i] = apart;
    }
    answers.emplace_back(count);
    for (size_t h = 0; h < 2; ++h) answers[0].share[h].fill(h ? 0.5f : 0.3f);
    for (Buffer<float>& plane : answers[0].difference) plane.fill(-0.4f);
    filtered.emplace_back(3 * count, 1.0f);
    bins = Buffer<GateBin>(count, {});
    gates = Buffer<flat::GateVerdict>(count, {});
    still = Buffer<uint8_t>(count, 0);
  }
  flat::NoiseResponse run() const {
    return noiseResponse({image, inputs, data, differences, answers, filtered, bins, gates, still});
  }
};

TEST(NoiseResponse, OfOnePixelByHand) {
  ByHand pixel({{1, 3, -2}});
  for (float& residual : pixel.bins[0].residual) residual = 0.2f;
  const float variance = 0.75f * 0.25f * 4, own = (0.3f / 0.75f + 0.5f / 0.25f) * variance;
  const float covariance = 0.5f * (own + 0.5f * 0.2f * 2 - 0.5f * 0.4f * 2), spread = own / 4;
  EXPECT_FLOAT_EQ(pixel.run().covariance[0][0], covariance);
  EXPECT_FLOAT_EQ(pixel.run().spread[0][0], spread);
  pixel.gates[0].k = 0.5f;
  EXPECT_FLOAT_EQ(pixel.run().covariance[0][0], (covariance + variance) / 2);
  EXPECT_FLOAT_EQ(pixel.run().spread[0][0], spread + (variance - spread) / 4);
}

TEST(NoiseResponse, AComponentIsNoMoreThanTheLightAndNoLessThanNothing) {
  const float variance = 0.75f * 0.25f, whole = (0.3f / 0.75f + 0.5f / 0.25f) * variance;
  EXPECT_FLOAT_EQ(ByHand({{3, 1, 1}}).run().spread[0][0], whole / 4);
  EXPECT_EQ(ByHand({{1, 3, 1}}).run().spread[0][0], 0);
}

// A pixel whose halves are the same is told by those around it, two pixels away at most.
TEST(NoiseResponse, PartsArePooled) {
  for (const size_t noisy : {2u, 3u}) {
    std::vector<std::array<float, 3>> pixels(4, {1, 1, 0});
    pixels[noisy] = {3, 1, 2};
    ByHand column(pixels);
    column.image.dataWindow = {0, 0, 1, 4};
    for (const char* name : {"variance.R", "variance.G", "variance.B"})
      column.image.channels.push_back({name, PixelType::Float, Buffer<float>(4, 1.0f), {}});
    column.inputs.variance = true;
    EXPECT_EQ(column.run().spread[0][0] > 0, noisy == 2);
  }
}

TEST(NoiseResponse, HalvesThatAreNotFiniteDoNotDiffer) {
  ByHand pixel({{1, 3, -2}});
  for (const char* half : {"half0.", "half1."})
    for (const std::string name : flat::kRgbNames)
      pixel.image.channels.push_back({half + name,
                                      PixelType::Float,
                                      Buffer<float>(1, name == "R"    ? std::nanf("")
                                                       : *half == '0' ? 1.0f
                                                                      : 3.0f),
                                      {}});
  const HalfDifferences found = halfDifferences(pixel.image, pixel.inputs, pixel.data);
  EXPECT_EQ(found.light[0][0], 0);
}

}  // namespace
}  // namespace fathom::deep
