// The network's planes where values go beyond their bounds, by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "flat/neural_planes.h"

namespace fathom::flat {
namespace {

Image blocks(int count) {
  Image image{{0, 0, 8 * count, 8}, {0, 0, 8 * count, 8}, {}, {}};
  for (const char* name : {"R", "G", "B"}) image.add(name);
  return image;
}

void fillBlock(Image& image, int block, float value) {
  for (const char* name : {"R", "G", "B"})
    for (int y = 0; y < 8; ++y)
      for (int x = 8 * block; x < 8 * block + 8; ++x) image.find(name)->values[image.dataWindow.index(x, y)] = value;
}

// The plane of a light as the network sees it: a logarithm that the kernels make.
float logarithmOf(float light) {
  return std::log1p(light);
}

TEST(NeuralPlanes, ExposureOfTheDarkestFramesIsBounded) {
  Image image = blocks(2);
  fillBlock(image, 0, 1e-40f);
  fillBlock(image, 1, 1e-40f);
  EXPECT_EQ(exposureOf(image), 1e30f);
  fillBlock(image, 0, 1e-25f);
  fillBlock(image, 1, 4e-25f);
  EXPECT_NEAR(exposureOf(image) * 1e-25f, 0.1, 1e-6);
}

// The dark blocks count as a thousandth of the mean, in which one of a million times their light has no part.
TEST(NeuralPlanes, AnAbsurdBlockDoesNotExposeTheOthers) {
  Image image = blocks(8);
  for (int b = 0; b < 8; ++b) fillBlock(image, b, b == 3 ? 1e9f : b % 2 ? 1e-5f : 1);
  const double others = (4 + 3e-5) / 7, least = 1e-3 * others;
  const double mean = (std::log(1e9) + 3 * std::log(least)) / 8;
  EXPECT_NEAR(exposureOf(image), 0.2 / std::exp(mean), 1e-5 * 0.2 / std::exp(mean));
}

TEST(NeuralPlanes, AnAbsurdDepthIsNotTheMiddle) {
  Image image = blocks(3);
  fillBlock(image, 1, 1);
  Buffer<float>& z = image.add("Z").values;
  for (size_t i = 0; i < z.size(); ++i) z[i] = i % 2 ? 2 : 6;
  z[5] = 1e12f;
  z[6] = -3;
  z[8] = 0;
  const double middle = (2.0 * 95 + 6.0 * 94) / 189;
  NeuralPlanes planes(image);
  planes.select(Light::Whole);
  const float* depth = planes.input().planes.row(9, 0);
  for (size_t i = 0; i < 24; ++i) {
    const double value = std::max(0.0, double(z[i]));
    EXPECT_NEAR(depth[i], value / (value + middle), 1e-6) << i;
  }
  image.find("Z")->values.fill(0);
  EXPECT_EQ(NeuralPlanes(image).input().planes.row(9, 0)[3], 0);
}

// Light beyond the bound, of a frame so dark that its exposure is: what is multiplied ends at 1e30.
TEST(NeuralPlanes, ExposedLightEndsAtItsBound) {
  Image image = blocks(8);
  for (const char* group : {"diffuse.", "specular."})
    for (const char* name : {"R", "G", "B"}) image.add(std::string(group) + name, 1e-42f);
  for (int b = 0; b < 8; ++b) fillBlock(image, b, 1e-40f);
  for (const char* name : {"R", "G", "B"}) {
    image.find(name)->values[3] = image.find(std::string("specular.") + name)->values[3] = 1e15f;
    image.add(std::string("variance.") + name, 1e15f);
  }
  const float dark = 1e-42f * 1e30f;
  NeuralPlanes planes(image);
  EXPECT_EQ(planes.exposure(), 1e30f);
  for (const Light light : {Light::Whole, Light::Diffuse, Light::Specular}) {
    planes.select(light);
    const nn::CompositionalInput input = planes.input();
    const bool bright = light != Light::Diffuse;
    EXPECT_FLOAT_EQ(input.colour.row(1, 0)[3], bright ? 1e30f : dark);
    EXPECT_NEAR(input.planes.row(0, 0)[3], logarithmOf(bright ? 1e30f : dark), 1e-4);
    EXPECT_NEAR(input.planes.row(17, 0)[3], logarithmOf(light == Light::Diffuse ? 1e30f : 0), 1e-4);
    EXPECT_NEAR(input.planes.row(11, 0)[4], logarithmOf(8), 1e-5);
    for (size_t p = 0; p < input.planes.plane.size(); ++p)
      for (size_t i = 0; i < 16; ++i) ASSERT_TRUE(std::isfinite(input.planes.row(p, 0)[i])) << p << ", " << i;
  }
}

}  // namespace
}  // namespace fathom::flat
