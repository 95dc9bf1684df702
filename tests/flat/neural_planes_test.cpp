// The network's planes against those of its training (tests/flat/neural_planes.py made the file), and laws of theirs.
#include "flat/neural_planes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "nn/weights.h"
#include "tests/reference/noisy_flat.h"

namespace fathom::flat {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();

const nn::WeightFile& stored() {
  static const nn::WeightFile file = nn::readWeights(FATHOM_NEURAL_PLANES);
  return file;
}

Image storedImage(const std::string& name) {
  const std::string beginning = name + "/in/";
  Image image;
  for (const auto& [tensor, values] : stored().tensors) {
    if (!tensor.starts_with(beginning)) continue;
    image.dataWindow = image.displayWindow = {4, -2, 4 + int(values.shape[1]), -2 + int(values.shape[0])};
    image.planes.push_back({tensor.substr(beginning.size()), values.values.copy()});
  }
  return image;
}

// Every value of the padded planes equals that of the pixel that it repeats.
void expectPlanes(const nn::ConstPlanes& found, const NeuralPlanes& size, const nn::Tensor& expected) {
  ASSERT_EQ(found.plane.size(), size_t(expected.shape[0]));
  const int height = int(expected.shape[1]), width = int(expected.shape[2]);
  for (size_t p = 0; p < found.plane.size(); ++p)
    for (int y = 0; y < size.height(); ++y)
      for (int x = 0; x < size.width(); ++x) {
        const size_t i =
            (p * size_t(height) + size_t(std::min(y, height - 1))) * size_t(width) + size_t(std::min(x, width - 1));
        const float e = expected.values[i];
        ASSERT_NEAR(found.row(p, y)[x], e, 2e-6f + 2e-6f * std::abs(e)) << "plane " << p << ", " << x << " " << y;
      }
}

void expectDivisor(const NeuralPlanes& planes, const nn::Tensor& expected) {
  size_t i = 0;
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < int(expected.shape[1]); ++y)
      for (int x = 0; x < int(expected.shape[2]); ++x, ++i)
        ASSERT_FLOAT_EQ(planes.restoring(c, y, x) * planes.exposure(), expected.values[i])
            << c << ", " << x << " " << y;
}

TEST(NeuralPlanes, EqualTraining) {
  int compared = 0;
  for (const char* name : {"full", "whole-variance", "halves", "no-albedo", "light", "black"}) {
    const Image image = storedImage(name);
    NeuralPlanes planes(image);
    for (const auto& [light, called] :
         {std::pair{Light::Whole, "rgb"}, {Light::Diffuse, "diffuse"}, {Light::Specular, "specular"}}) {
      const std::string tensor = std::string(name) + "/" + called;
      ASSERT_EQ(hasLight(image, light), stored().tensors.contains(tensor + "/planes")) << tensor;
      if (!hasLight(image, light)) continue;
      SCOPED_TRACE(tensor);
      planes.select(light);
      expectPlanes(planes.input().planes, planes, stored().tensors.at(tensor + "/planes"));
      expectPlanes(planes.input().colour, planes, stored().tensors.at(tensor + "/colour"));
      expectDivisor(planes, stored().tensors.at(tensor + "/divisor"));
      ++compared;
    }
  }
  EXPECT_EQ(compared, 17);
}

// What is not finite is as good as 0, wherever it stands.
TEST(NeuralPlanes, NonFiniteValuesAreZeros) {
  Image zeros = storedImage("full"), odd = storedImage("full");
  const size_t area = odd.dataWindow.area();
  ASSERT_GT(area, 0U);
  size_t at = 3;
  for (size_t p = 0; p < odd.planes.size(); ++p, at += 5) {
    const size_t i = at % area;
    zeros.planes[p].values[i] = 0;
    odd.planes[p].values[i] = p % 3 == 0 ? kNaN : p % 3 == 1 ? kInf : -kInf;
  }
  NeuralPlanes a(zeros), b(odd);
  EXPECT_EQ(a.exposure(), b.exposure());
  for (const Light light : {Light::Whole, Light::Diffuse, Light::Specular}) {
    a.select(light);
    b.select(light);
    for (size_t p = 0; p < nn::kInputPlanes; ++p)
      for (int y = 0; y < a.height(); ++y)
        for (int x = 0; x < a.width(); ++x)
          ASSERT_EQ(a.input().planes.row(p, y)[x], b.input().planes.row(p, y)[x]) << "plane " << p;
  }
}

// What is left beside a component, and what is brighter than all light.
TEST(NeuralPlanes, OddLightIsWithinBounds) {
  Image image = storedImage("full");
  for (const char* name : kRgbNames) {
    image.find(name)->values[0] = 1e-3f;
    image.find(std::string("diffuse.") + name)->values[0] = 50;
    image.find(name)->values[1] = 1e15f;
    image.find(std::string("diffuse.") + name)->values[1] = 1e15f;
  }
  NeuralPlanes planes(image);
  planes.select(Light::Diffuse);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(planes.input().planes.row(16 + c, 0)[0], 0) << "the rest is no less than nothing";
    EXPECT_TRUE(std::isfinite(planes.input().planes.row(c, 0)[1]));
  }
}

TEST(NeuralPlanes, ExposureFollowsTheScale) {
  Image image = reference::makeNoisyFlat(40, 30, 1).noisy;
  const float before = exposureOf(image);
  for (const char* name : kRgbNames)
    for (float& v : image.find(name)->values) v *= 32;
  EXPECT_EQ(exposureOf(image) * 32, before);
  for (const char* name : kRgbNames) image.find(name)->values.fill(-1);
  EXPECT_EQ(exposureOf(image), 1);
  // Eight blocks: those that are nearly black count as a thousandth of the mean.
  Image blocks{{0, 0, 64, 8}, {0, 0, 64, 8}, {}, {}};
  for (const char* name : kRgbNames) {
    Buffer<float>& values = blocks.add(name, 1).values;
    for (size_t i = 0; i < values.size(); ++i)
      if (i % 64 < 8) values[i] = 1e-12f;
  }
  EXPECT_NEAR(exposureOf(blocks), 0.2 / std::pow(1e-3 * 7 / 8, 1.0 / 8), 1e-5);
}

}  // namespace
}  // namespace fathom::flat
