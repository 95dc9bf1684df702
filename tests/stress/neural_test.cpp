// The networks of flat frames on values at the ends of what files hold: against the twin, and their laws. What the exposure of
// the whole frame decides moves everywhere; how much, these tests measure.
#include "flat/neural.h"

#include <gtest/gtest.h>

#include <map>

#include "flat/finite.h"
#include "flat/neural_planes.h"
#include "tests/reference/compositional.h"
#include "tests/reference/noisy_flat.h"
#include "tests/stress/extreme_noisy.h"
#include "tests/stress/record.h"

namespace fathom::flat {
namespace {

using reference::PlainWeights;
using reference::Volume;
using stress::extremeFlat;
using stress::record;

const nn::CompositionalNet& net(const std::string& name) {
  static std::map<std::string, nn::CompositionalNet> nets;
  auto found = nets.find(name);
  if (found == nets.end())
    found = nets.emplace(name, nn::CompositionalNet(nn::readWeights(FATHOM_DEMO "/../models/" + name + ".safetensors")))
                .first;
  return found->second;
}

PlainWeights plain(const std::string& name) {
  const nn::WeightFile file = nn::readWeights(FATHOM_DEMO "/../models/" + name + ".safetensors");
  PlainWeights result;
  result.metadata = file.metadata;
  for (const auto& [key, tensor] : file.tensors)
    result.tensors[key] = {tensor.shape, {tensor.values.begin(), tensor.values.end()}};
  return result;
}

Volume volumeOf(const nn::ConstPlanes& planes, int channels, int height, int width) {
  Volume result(channels, height, width);
  for (int c = 0; c < channels; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) result.at(c, y, x) = double(planes.row(size_t(c), y)[x]);
  return result;
}

// Of the brightest value: kernels reach over all of so small a frame.
void expectLikeTwin(const std::string& model, int width, int height, int components, float largest, unsigned seed) {
  constexpr double kBound = 1e-4;
  const Image noisy = extremeFlat({.width = width, .height = height, .seed = seed, .largest = largest});
  NeuralPlanes planes(noisy);
  planes.select(Light::Whole);
  const nn::CompositionalInput input = planes.input();
  const PlainWeights weights = plain(model);
  const Volume expected =
      reference::CompositionalTwin(weights).denoise(volumeOf(input.planes, nn::kInputPlanes, input.height, input.width),
                                                    volumeOf(input.colour, 3, input.height, input.width), components);
  std::vector<float> found(expected.values.size());
  nn::CompositionalNet::Workspace workspace;
  net(model).denoise(input, {0, 0, input.width, input.height}, components,
                     nn::denseRows(found.data(), 3, input.height, input.width), workspace);
  double most = 0, worst = 0;
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < input.height; ++y)
      for (int x = 0; x < input.width; ++x) most = std::max(most, double(input.colour.row(size_t(c), y)[x]));
  for (size_t i = 0; i < found.size(); ++i)
    worst = std::max(worst, std::fabs(double(found[i]) - expected.values[i]) / (most + 1e-30));
  record("network " + model + ", K = " + std::to_string(components), "values, variance 0 and huge: against the twin",
         worst, kBound);
  EXPECT_LT(worst, kBound) << model << " " << width << "x" << height << " to " << largest;
}

TEST(StressNeural, EqualsItsTwin) {
  for (int round = 0; round < stress::rounds(); ++round)
    for (const float largest : {6e4f, 9e14f}) {
      expectLikeTwin("small", 14, 11, 1, largest, unsigned(round + 1));
      expectLikeTwin("small", 1, 17, 1, largest, unsigned(round + 2));
      expectLikeTwin("small", 9, 1, 2, largest, unsigned(round + 3));
      expectLikeTwin("small", 8, 7, 4, largest, unsigned(round + 4));
    }
  expectLikeTwin("base", 8, 8, 1, 6e4f, 5);
}

double most(const Image& image) {
  double result = 0;
  for (const Plane& plane : image.planes)
    for (const float v : plane.values) result = std::max(result, std::fabs(double(v)));
  return result;
}

TEST(StressNeural, AnyFrameGivesFiniteColoursThatAreNotNegative) {
  for (int round = 0; round < stress::rounds(); ++round)
    for (const auto& [width, height] : {std::pair{1, 1}, {1, 29}, {37, 1}, {24, 17}})
      for (const float largest : {6e4f, 9e14f})
        for (const bool all : {true, false})
          for (const int components : {0, 4}) {
            const Image noisy = extremeFlat({.width = width,
                                             .height = height,
                                             .seed = unsigned(round + width),
                                             .largest = largest,
                                             .components = all,
                                             .features = all});
            for (const Plane& plane : denoiseNeural(net("small"), {.components = components}, noisy).planes)
              for (const float v : plane.values) ASSERT_TRUE(isFinite(v) && v >= 0) << plane.name << " " << v;
          }
  // Sparse, and empty.
  for (const size_t lit : {0U, 5U}) {
    Image sparse = extremeFlat({.width = 40, .height = 30});
    for (Plane& plane : sparse.planes)
      for (size_t i = 0; i < plane.values.size(); ++i)
        if (i % 240 >= lit) plane.values[i] = 0;
    const Image found = denoiseNeural(net("small"), {}, sparse);
    for (const std::string c : kRgbNames)
      for (size_t i = 0; i < 1200; ++i) {
        ASSERT_TRUE(isFinite(found.get(c).values[i]));
        if (i % 240 >= lit) {
          ASSERT_EQ(found.get(c).values[i], 0);
        }
      }
  }
}

Image render(int width, int height, unsigned seed) {
  Image noisy = reference::makeNoisyFlat(width, height, seed).noisy;
  noisy.add("A", 1);
  noisy.add("Z", 3);
  return noisy;
}

// Twelve powers of ten by the exposure alone: it is a float, so that products with it round.
TEST(StressNeural, FollowsTheExposure) {
  constexpr double kBound = 1e-4;
  const auto look = [&](const std::string& model, int components, std::span<const float> scales) {
    const Image noisy = render(36, 28, 3);
    const Image expected = denoiseNeural(net(model), {.components = components}, noisy);
    double worst = 0;
    for (const float scale : scales) {
      const Image found = denoiseNeural(net(model), {.components = components}, stress::scaled(noisy, scale));
      for (const Plane& plane : expected.planes)
        for (size_t i = 0; i < plane.values.size(); ++i)
          worst = std::max(
              worst, std::fabs(double(found.get(plane.name).values[i]) / double(scale) - double(plane.values[i])) /
                         most(expected));
    }
    EXPECT_LT(worst, kBound) << model << " " << components;
    record("network " + model + ", K = " + std::to_string(components), "exposure over 12 powers of ten", worst, kBound);
  };
  for (const int components : {1, 2, 4}) look("small", components, stress::kRoundedScales);
  look("small", 1, stress::kExactScales);
  look("base", 1, std::span(stress::kRoundedScales).first(1));
}

// Where the window lies does not matter, what lies out of reach neither where it has no light: the same bits. With light it
// has its share in the exposure: of 96 blocks, one that is absurd moves the others' exposure by a factor of at most 1.5.
TEST(StressNeural, PoisonStaysWithinReach) {
  constexpr int kLength = 192;
  constexpr double kBound = 0.1;
  const nn::CompositionalNet& small = net("small");
  const NeuralParams params{.components = 1};
  Image clean = render(kLength, 32, 1);
  for (const char* name : {"albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z", "variance.Z"})
    clean.add(name, 0.4f);
  const Image expected = denoiseNeural(small, params, clean);
  Image shifted = clean.copy();
  shifted.dataWindow = {17, -3, 17 + kLength, 29};
  const Image there = denoiseNeural(small, params, shifted);
  for (const char* c : kRgbNames)
    for (size_t i = 0; i < clean.dataWindow.area(); ++i)
      ASSERT_TRUE(stress::sameBits(there.get(c).values[i], expected.get(c).values[i]));
  stress::Draw draw(3);
  double worst = 0;
  for (int round = 0; round < 20 * stress::rounds(); ++round) {
    Image image = clean.copy();
    const size_t x = draw.below(kLength), i = x + kLength * draw.below(32);
    Plane& plane =
        draw.below(2) ? *image.find(kRgbNames[draw.below(3)]) : image.planes[draw.below(unsigned(image.planes.size()))];
    plane.values[i] = draw.of({stress::kNan, stress::kInfinity, -stress::kInfinity, -1, 1e20f, 9e14f, 1e-42f});
    SCOPED_TRACE(fmt::format("{} {} at {}", plane.name, plane.values[i], x));
    const bool light = plane.name.size() == 1 && plane.name != "A";  // or depth, of which the mean counts
    const Image found = denoiseNeural(small, params, image);
    for (const char* c : kRgbNames)
      for (size_t p = 0; p < clean.dataWindow.area(); ++p) {
        const float v = found.get(c).values[p], was = expected.get(c).values[p];
        ASSERT_TRUE(isFinite(v) && v >= 0);
        if (std::abs(int(p % kLength) - int(x)) <= small.halo(1)) continue;
        if (!light) {
          ASSERT_TRUE(stress::sameBits(v, was)) << p % kLength << ": " << v << ", " << was;
        }
        worst = std::max(worst, double(std::fabs(v - was)) / double(was));
      }
  }
  EXPECT_LT(worst, kBound);
  record("network small, K = 1", "poison: what moves out of reach, by the exposure", worst, kBound);
}

// Kernels are averages: what is filtered stays between the least and the most of the frame.
TEST(StressNeural, ValuesStayBetweenThoseOfTheFrame) {
  constexpr double kBound = 1e-5;
  double worst = 0;
  for (int round = 0; round < 3 * stress::rounds(); ++round)
    for (const int components : {1, 4}) {
      const Image noisy = extremeFlat({.width = 20, .height = 16, .seed = unsigned(round + 9), .components = false});
      const Image found = denoiseNeural(net("small"), {.components = components}, noisy);
      double largest = 0;
      for (const char* c : kRgbNames)
        for (const float v : noisy.get(c).values) largest = std::max(largest, double(v));
      worst = std::max(worst, most(found) / largest - 1);
    }
  record("network small", "averages beyond what they are of", std::max(worst, 0.0), kBound);
  EXPECT_LT(worst, kBound);
}

}  // namespace
}  // namespace fathom::flat
