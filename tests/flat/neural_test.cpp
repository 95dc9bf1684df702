#include "flat/neural.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "flat/finite.h"
#include "flat/light.h"
#include "flat/neural_planes.h"
#include "tests/reference/compositional.h"
#include "tests/reference/noisy_flat.h"

namespace fathom::flat {
namespace {

using reference::makeNoisyFlat;

const nn::CompositionalNet& net() {
  static const nn::CompositionalNet made(
      nn::readWeights(reference::safetensors(reference::randomCompositional(16, 7)), "random"));
  return made;
}

Image withAlpha(Image image) {
  image.add("A", 1);
  image.add("Z", 3);
  return image;
}

Image withoutComponents(Image image) {
  std::erase_if(image.planes, [](const Plane& plane) {
    return plane.name.find("diffuse.") != std::string::npos || plane.name.find("specular.") != std::string::npos;
  });
  return image;
}

// The greatest difference, by the greatest value.
double difference(const Image& a, const Image& b, double scale = 1) {
  double most = 0, largest = 0;
  for (const Plane& plane : a.planes)
    for (size_t i = 0; i < plane.values.size(); ++i) {
      const double e = double(plane.values[i]), f = double(b.get(plane.name).values[i]) / scale;
      most = std::max(most, std::abs(e - f));
      largest = std::max(largest, std::abs(e));
    }
  return most / largest;
}

bool same(const Image& a, const Image& b) {
  return difference(a, b) == 0;
}

Image withAlbedo(Image image) {
  for (size_t c = 0; c < 3; ++c) {
    Buffer<float>& values = image.add("albedo." + std::string(kRgbNames[c])).values;
    for (size_t i = 0; i < values.size(); ++i) values[i] = float((i * (c + 3)) % 11) / 10;
  }
  return image;
}

// Against the network itself, on planes that are made here, and with its light kept.
void expectTheNetwork(const Image& noisy, std::initializer_list<Light> lights, int components) {
  NeuralPlanes planes(noisy);
  const int width = noisy.dataWindow.width(), height = noisy.dataWindow.height();
  const size_t area = noisy.dataWindow.area();
  std::vector<float> out(3 * size_t(planes.height()) * size_t(planes.width()));
  nn::CompositionalNet::Workspace workspace;
  Image wanted{noisy.dataWindow, noisy.displayWindow, {}, {}};
  for (const char* c : kRgbNames) wanted.add(c, 0);
  for (const Light light : lights) {
    planes.select(light);
    net().denoise(planes.input(), {0, 0, planes.width(), planes.height()}, components,
                  nn::denseRows(out.data(), 3, planes.height(), planes.width()), workspace);
    for (size_t c = 0; c < 3; ++c) {
      Buffer<float> values(area);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
          const size_t i = size_t(y) * size_t(width) + size_t(x);
          const size_t at = (c * size_t(planes.height()) + size_t(y)) * size_t(planes.width()) + size_t(x);
          values[i] = std::max(out[at] * planes.restoring(c, y, x), 0.0f);
          wanted.find(kRgbNames[c])->values[i] += values[i];
        }
      if (light != Light::Whole) wanted.add(prefixOf(light) + kRgbNames[c]).values = std::move(values);
    }
  }
  keepLight(noisy, std::vector<uint8_t>(area, 0), wanted, 1 / planes.exposure());
  const Image found = denoiseNeural(net(), {.components = components}, noisy);
  ASSERT_EQ(found.planes.size(), wanted.planes.size());
  EXPECT_EQ(found.dataWindow, noisy.dataWindow);
  for (const Plane& plane : wanted.planes)
    for (size_t i = 0; i < area; ++i)
      ASSERT_FLOAT_EQ(found.get(plane.name).values[i], plane.values[i]) << plane.name << " " << i;
}

TEST(Neural, IsTheNetworkOutOfItsExposure) {
  const Image noisy = withAlpha(makeNoisyFlat(22, 14, 1).noisy);
  for (const int components : {1, 2, 4}) expectTheNetwork(withoutComponents(noisy.copy()), {Light::Whole}, components);
  expectTheNetwork(noisy, {Light::Diffuse, Light::Specular}, 1);
}

TEST(Neural, DiffuseLightComesBackTimesTheAlbedo) {
  const Image noisy = withAlbedo(withAlpha(makeNoisyFlat(22, 14, 1).noisy));
  expectTheNetwork(noisy, {Light::Diffuse, Light::Specular}, 1);
  NeuralPlanes planes(noisy);
  planes.select(Light::Diffuse);
  EXPECT_FLOAT_EQ(planes.restoring(1, 0, 1) * planes.exposure(), 0.4f + kLeastAlbedo);
  planes.select(Light::Specular);
  EXPECT_FLOAT_EQ(planes.restoring(1, 0, 1) * planes.exposure(), 1);
}

// Light on black surfaces, divided by next to nothing, and white ones beside them.
TEST(Neural, WhatComesBackTimesAnAlbedoIsBounded) {
  Image noisy = withAlbedo(withAlpha(makeNoisyFlat(24, 16, 5).noisy));
  for (const std::string c : kRgbNames) {
    for (const std::string part : {"", "diffuse."}) noisy.find(part + c)->values.fill(9e14f);
    Buffer<float>& albedo = noisy.find("albedo." + c)->values;
    for (size_t i = 0; i < albedo.size(); ++i) albedo[i] = i % 3 ? 0 : 1;
  }
  const Image found = denoiseNeural(net(), {}, noisy);
  float most = 0;
  for (const Plane& plane : found.planes)
    for (const float v : plane.values) {
      ASSERT_TRUE(isFinite(v) && v >= 0) << plane.name << " " << v;
      most = std::max(most, v);
    }
  EXPECT_EQ(most, kLargest);
}

// The same of so few pixels that their light is not kept.
TEST(Neural, TheSumOfComponentsIsBounded) {
  Image noisy = withAlbedo(withAlpha(makeNoisyFlat(8, 8, 5).noisy));
  for (const std::string c : kRgbNames)
    for (const std::string part : {"", "diffuse.", "specular."}) {
      noisy.find(part + c)->values.fill(9e14f);
      Buffer<float>& albedo = noisy.find("albedo." + c)->values;
      for (size_t i = 0; i < albedo.size(); ++i) albedo[i] = i % 3 ? 0 : 1;
    }
  const Image found = denoiseNeural(net(), {}, noisy);
  float diffuse = 0;
  for (const float v : found.get("diffuse.G").values) diffuse = std::max(diffuse, v);
  EXPECT_EQ(diffuse, kLargest);
  for (const float v : found.get("G").values) EXPECT_EQ(v, kLargest);
}

TEST(Neural, ComponentsAddUp) {
  const Image found = denoiseNeural(net(), {}, withAlpha(makeNoisyFlat(20, 16, 2).noisy));
  ASSERT_EQ(found.planes.size(), 9U);
  for (const std::string c : kRgbNames)
    for (size_t i = 0; i < found.dataWindow.area(); ++i)
      ASSERT_FLOAT_EQ(found.get(c).values[i],
                      found.get("diffuse." + c).values[i] + found.get("specular." + c).values[i]);
}

TEST(Neural, AScaledFrameIsDenoisedAlike) {
  const Image noisy = withAlpha(makeNoisyFlat(36, 28, 3).noisy);
  const Image expected = denoiseNeural(net(), {.components = 2}, noisy);
  for (const float scale : {1e-6f, 0.3f, 64.0f, 7e4f}) {
    Image scaled = noisy.copy();
    for (Plane& plane : scaled.planes) {
      const bool variance = plane.name.starts_with("variance.");
      const bool light = plane.name != "A" && plane.name != "Z" && !plane.name.ends_with("samples");
      for (float& v : plane.values) v *= variance ? scale * scale : light ? scale : 1;
    }
    EXPECT_LT(difference(expected, denoiseNeural(net(), {.components = 2}, scaled), double(scale)), 1e-4) << scale;
  }
}

TEST(Neural, SameBitsForAnyNumberOfThreads) {
  const Image noisy = withAlpha(makeNoisyFlat(300, 200, 4).noisy);
  const NeuralParams params{.components = 2, .memory = 20'000'000};  // in several tiles
  const Image expected = denoiseNeural(net(), params, noisy);
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_TRUE(same(expected, denoiseNeural(net(), params, noisy)));
}

TEST(Neural, ConvergedAndEmptyPixelsKeepTheRender) {
  Image noisy = withAlpha(makeNoisyFlat(40, 24, 5).noisy);
  for (const size_t i : {5U, 410U})
    for (const std::string c : kRgbNames) noisy.find("variance." + c)->values[i] = 0;
  for (Plane& plane : noisy.planes) plane.values[100] = 0;
  const Image found = denoiseNeural(net(), {}, noisy);
  for (const std::string c : kRgbNames) {
    for (const size_t i : {5U, 410U}) {
      EXPECT_EQ(found.get(c).values[i], noisy.get(c).values[i]);
      EXPECT_EQ(found.get("diffuse." + c).values[i], noisy.get("diffuse." + c).values[i]);
    }
    EXPECT_EQ(found.get(c).values[100], 0);
    EXPECT_NE(found.get(c).values[6], noisy.get(c).values[6]);
  }
}

// Each of them is denoised: noise that is not known, black that is covered, light that is not, one channel of it.
TEST(Neural, WhatIsNotSettledIsDenoised) {
  Image noisy = withoutComponents(withAlpha(makeNoisyFlat(24, 16, 1).noisy));
  noisy.find("variance.G")->values[30] = std::numeric_limits<float>::quiet_NaN();
  for (const char* c : kRgbNames) noisy.find(c)->values[100] = 0;
  noisy.find("A")->values[200] = noisy.find("A")->values[300] = 0;
  noisy.find("R")->values[300] = 0;
  const Image found = denoiseNeural(net(), {}, noisy);
  for (const size_t i : {30U, 100U, 200U, 300U}) EXPECT_NE(found.get("G").values[i], noisy.get("G").values[i]) << i;
}

// The whole render where it has converged, though its components are not all of it.
TEST(Neural, SettledPixelsAreTheWholeRender) {
  Image noisy = withAlpha(makeNoisyFlat(24, 16, 1).noisy);
  for (const std::string c : kRgbNames) {
    noisy.find("variance." + c)->values[50] = 0;
    noisy.find(c)->values[50] = 0.7f;
    noisy.find("diffuse." + c)->values[50] = 0.2f;
    noisy.find("specular." + c)->values[50] = std::numeric_limits<float>::quiet_NaN();
  }
  const Image found = denoiseNeural(net(), {}, noisy);
  EXPECT_EQ(found.get("G").values[50], 0.7f);
  EXPECT_EQ(found.get("diffuse.G").values[50], 0.2f);
  EXPECT_EQ(found.get("specular.G").values[50], 0);
}

// Skipped tiles change nothing but the time.
TEST(Neural, TilesWithoutNoiseAreSkipped) {
  const Image noisy = withAlpha(makeNoisyFlat(512, 64, 6).noisy);
  Image half = noisy.copy();
  for (const std::string c : kRgbNames)
    for (size_t i = 0; i < 512U * 64; ++i)
      if (i % 512 >= 200) half.find("variance." + c)->values[i] = 0;
  NeuralCounts all, fewer;
  const NeuralParams params{.components = 1};
  denoiseNeural(net(), params, noisy, {}, &all);
  EXPECT_EQ(all.denoised, 2U * 512 * 64);
  EXPECT_EQ(all.skipped, 0U);
  const Image cut = denoiseNeural(net(), params, half, {}, &fewer);
  EXPECT_EQ(fewer.denoised + fewer.skipped, 2U * 512 * 64);
  EXPECT_EQ(fewer.skipped, 2U * (512 - 200) * 64) << "tiles end where the noise does";
  // What the planes are noisy around is as it was, what has converged is the render.
  const Image whole = denoiseNeural(net(), params, noisy);
  const int seen = 200 - net().halo(1);
  for (const std::string c : kRgbNames)
    for (size_t i = 0; i < 512U * 64; ++i) {
      const int x = int(i % 512);
      if (x < seen) {
        ASSERT_NEAR(cut.get(c).values[i], whole.get(c).values[i], 1e-5) << x;
      }
      if (x >= 200) {
        ASSERT_EQ(cut.get(c).values[i], std::max(half.get(c).values[i], 0.0f)) << x;
      }
    }
}

TEST(Neural, WhatNobodyAsksForIsSkipped) {
  const Image noisy = withoutComponents(withAlpha(makeNoisyFlat(320, 64, 6).noisy));
  Image part = noisy.copy();
  Buffer<float>& asked = part.add(kAsked).values;
  for (size_t i = 0; i < asked.size(); ++i) asked[i] = i % 320 < 100;
  NeuralCounts counts;
  const Image found = denoiseNeural(net(), {.components = 1}, part, {}, &counts);
  EXPECT_EQ(counts.denoised, 100U * 64);
  EXPECT_EQ(found.get("R").values[50 + 320], denoiseNeural(net(), {.components = 1}, noisy).get("R").values[50 + 320]);
  EXPECT_EQ(found.get("R").values[200 + 320], std::max(noisy.get("R").values[200 + 320], 0.0f));
}

TEST(Neural, OddValuesNeverSpread) {
  constexpr float kOdd[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1e30f,
                            1e14f, -5};
  Image noisy = withAlpha(makeNoisyFlat(33, 21, 8).noisy);
  size_t at = 0;
  for (Plane& plane : noisy.planes)
    for (const float odd : kOdd) plane.values[(at += 37) % plane.values.size()] = odd;
  for (const Image& image : {noisy.copy(), withoutComponents(noisy.copy())})
    for (const Plane& plane : denoiseNeural(net(), {.components = 4}, image).planes)
      for (const float v : plane.values) ASSERT_TRUE(isFinite(v) && v >= 0) << plane.name << " " << v;
}

TEST(Neural, TheColourAloneIsEnough) {
  Image bare{{0, 0, 5, 3}, {0, 0, 5, 3}, {}, {}};
  for (const char* name : kRgbNames) bare.add(name, 0.5f);
  for (const Plane& plane : denoiseNeural(net(), {}, bare).planes)
    for (const float v : plane.values) EXPECT_NEAR(v, 0.5f, 1e-5f);
  EXPECT_EQ(denoiseNeural(net(), {}, crop(bare, {})).planes.size(), 3U);
}

TEST(Neural, StopsAndTellsItsProgress) {
  const Image noisy = withAlpha(makeNoisyFlat(64, 48, 9).noisy);
  double last = 0;
  denoiseNeural(net(), {}, noisy,
                {[&](double done) {
                   EXPECT_GE(done, last);
                   last = done;
                 },
                 {}});
  EXPECT_EQ(last, 1);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(denoiseNeural(net(), {}, noisy, {{}, stop.get_token()}), Cancelled);
}

TEST(Neural, MemoryIsCounted) {
  const size_t pixels = 2'000'000;
  const size_t free = neuralBytes(net(), {.components = 4}, pixels);
  EXPECT_GT(free, pixels * 500);
  EXPECT_LT(neuralBytes(net(), {.components = 4, .memory = 50'000'000}, pixels), free / 2);
  EXPECT_LT(neuralBytes(net(), {.components = 1}, pixels), free);
  // However little there may be, one tile of 64 pixels a side and its halo is held; and no more than what there is to do.
  const double halo = 2.0 * net().halo(4), tile = net().bytesPerPixel(4) * (64 + halo) * (64 + halo);
  EXPECT_EQ(neuralBytes(net(), {.components = 4, .memory = 1}, pixels),
            neuralBytes(net(), {.components = 4, .memory = size_t(tile)}, pixels));
  EXPECT_EQ(neuralBytes(net(), {.components = 4, .memory = size_t(1) << 40}, pixels), free);
}

}  // namespace
}  // namespace fathom::flat
