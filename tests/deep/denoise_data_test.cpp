// What the deep filter reads of a frame: counts, and what halves and components weigh, by hand.
#include "deep/denoise_data.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace fathom::deep {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();

void put(DeepImage& image, const std::string& name, const std::vector<float>& values) {
  std::copy(values.begin(), values.end(), image.add(name, PixelType::Float).values.begin());
}

// A row of pixels with one bin each.
DeepImage binsOf(const std::vector<float>& alphas) {
  const int width = int(alphas.size());
  DeepImage image{{0, 0, width, 1}, {0, 0, width, 1}, Buffer<uint64_t>(alphas.size() + 1), {}, {}};
  for (size_t i = 0; i < image.offsets.size(); ++i) image.offsets[i] = i;
  put(image, "A", alphas);
  put(image, "Z", std::vector<float>(alphas.size(), 2));
  for (const char* name : {"R", "G", "B"}) put(image, name, alphas);
  return image;
}

DenoiseData dataOf(const DeepImage& image, const DenoiseInputs& inputs) {
  return prepareColours(image, inputs);
}

DenoiseInputs inputsOf(const DeepImage& image) {
  std::vector<std::string> names;
  for (const Channel& channel : image.channels) names.push_back(channel.name);
  return findDenoiseInputs(names, image.attributes);
}

TEST(DenoiseData, CountsAreOfTheFileOrOfTheAlphas) {
  DeepImage image = binsOf({1, 0.5f, 0.25f, 1, 1, 1, 1});
  for (const auto& [spp, expected] : {std::pair(16, 16.0f), {1, 1.0f}, {0, 64.0f}}) {
    if (spp > 0)
      image.attributes.set("fathom:spp", spp);
    else
      image.attributes = {};
    const DenoiseData data = dataOf(image, inputsOf(image));
    for (size_t b = 0; b < 7; ++b) EXPECT_FLOAT_EQ(data.count[b], expected * image.get("A")[b]) << spp;
  }
  image.attributes.set("fathom:spp", 16);
  put(image, "samples", {3, 0.5f, 1e-4f, -2, kInf, kNaN, 1e7f});
  const DenoiseData data = dataOf(image, inputsOf(image));
  const float expected[] = {3, 0.5f, 0, 0, 0, 0, 1e7f};
  for (size_t b = 0; b < 7; ++b) EXPECT_EQ(data.count[b], expected[b]) << b;
}

// A bin's halves share its weight as their samples do; one that has none of either has no say.
TEST(DenoiseData, HalvesWeighAsTheirSamples) {
  const std::vector<float> n0 = {4, 3, 0, 16, 0, 1e-5f, kNaN}, n1 = {4, 13, 16, 0, 0, 2, 5};
  DeepImage image = binsOf({1, 0.5f, 1, 1, 1, 1, 1});
  for (const char* name : {"R", "G", "B"}) {
    put(image, std::string("half0.") + name, {0.2f, 0.2f, 0.2f, 0.2f, 0.2f, 0.2f, 0.2f});
    put(image, std::string("half1.") + name, {0.4f, 0.4f, 0.4f, 0.4f, 0.4f, 0.4f, 0.4f});
  }
  const DenoiseData alike = dataOf(image, inputsOf(image));
  put(image, "half0.samples", n0);
  put(image, "half1.samples", n1);
  const DenoiseData data = dataOf(image, inputsOf(image));
  for (size_t b = 0; b < 7; ++b) {
    const double alpha = double(image.get("A")[b]);
    const double a = n0[b] >= 1e-3f ? double(n0[b]) : 0, c = double(n1[b]), all = a + c;
    const double weights[] = {all > 0 ? 2 * a / all * alpha : 0, all > 0 ? 2 * c / all * alpha : 0};
    for (const size_t h : {0U, 1U}) {
      const float* sum = data.components[0].data.data() + 8 * b + 4 * h;
      EXPECT_NEAR(sum[3], weights[h], 1e-6) << b;
      EXPECT_NEAR(sum[1], weights[h] * (h ? 0.4 : 0.2) / alpha, 1e-6) << b;
      EXPECT_FLOAT_EQ(alike.components[0].data[8 * b + 4 * h + 3], float(alpha));
    }
  }
}

// Without halves a component has the square of its part of the light, as far as light tells.
TEST(DenoiseData, ComponentsHaveTheirPartOfTheVariance) {
  const std::vector<float> diffuse = {0.3f, 0, 1, 1, -0.5f}, specular = {0.1f, 0.4f, -1, -1 + 0x1p-24f, 1};
  DeepImage image = binsOf({1, 1, 1, 1, 1});
  for (const char* name : {"R", "G", "B"}) {
    put(image, std::string("diffuse.") + name, diffuse);
    put(image, std::string("specular.") + name, specular);
    put(image, std::string("variance.") + name, {0.5f, 0.5f, 0.5f, 0.5f, -1});
    for (size_t b = 0; b < 5; ++b) image.get(name)[b] = diffuse[b] + specular[b];
  }
  const DenoiseData data = dataOf(image, inputsOf(image));
  ASSERT_EQ(data.components.size(), 2U);
  const double parts[2][5] = {{0.75, 0, 0, 1e6, 0}, {0.25, 1, 0, 1e6, 0}};  // no more than a million times the light
  for (size_t k = 0; k < 2; ++k)
    for (size_t b = 0; b < 5; ++b) {
      const double expected = 0.5 * parts[k][b] * parts[k][b];
      EXPECT_NEAR(data.components[k].variance[2][b], expected, 1e-5 * expected) << k << ", " << b;
    }
}

}  // namespace
}  // namespace fathom::deep
