// What the layered network sees of deep frames, laws of it and against its training.
#include "deep/layer_samples.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>

#include "deep/layers_results.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/noisy_frame.h"

namespace fathom::deep {
namespace {

TEST(LayerSamples, SayWhatIsMissing) {
  const auto missing = [](std::vector<std::string> names, int spp) {
    Attributes attributes;
    if (spp) attributes.set("fathom:spp", spp);
    return describeMissing(findLayerInputs(names, attributes));
  };
  EXPECT_THAT(missing({"A", "B", "G", "R", "Z"}, 0),
              testing::ElementsAre("no diffuse.* and specular.*: all light is taken for one kind",
                                   "no albedo.* or N.*: the network has less to go by",
                                   "no samples and no fathom:spp: each deep sample is taken for one camera sample"));
  EXPECT_THAT(missing({"diffuse.R", "diffuse.G", "diffuse.B", "specular.R", "specular.G", "specular.B", "albedo.R",
                       "albedo.G", "albedo.B"},
                      8),
              testing::ElementsAre("no N.*: the network has less to go by"));
  const LayerInputs all = findLayerInputs(
      std::vector<std::string>{"diffuse.R", "diffuse.G", "diffuse.B", "specular.R", "specular.G", "specular.B"}, {});
  EXPECT_TRUE(layersRead(all, "diffuse.R") && layersRead(all, "A") && layersRead(all, "samples"));
  EXPECT_FALSE(layersRead(all, "R") || layersRead(all, "half0.R") || layersRead(all, "variance.N.X"));
}

// The same from R G B A Z alone, and a known input.
TEST(LayerSamples, TakeWhatThereIs) {
  DeepImage image = reference::makeDeep({{{2, 2, 0.25f}, {6, 6, 1}}, {{4, 4, 0.5f}}}, 2);
  for (const char* name : {"R", "G", "B"}) {
    Buffer<float>& values = image.find(name) ? image.find(name)->values : image.add(name, PixelType::Float).values;
    values[0] = 0.25f * 3, values[1] = 1, values[2] = 0.5f * 2;
  }
  const LayerSource source = layerSource(image);
  const LayerScale scale = measureLayers(source, {});
  EXPECT_NEAR(scale.depth, (0.25 * 2 + 0.75 * 6 + 0.5 * 4) / 1.5, 1e-6);
  const LayerRow row = layerRow(image, source.inputs, {2, scale.depth}, image.dataWindow.y0);
  ASSERT_EQ(row.samples.count(), 3U);
  EXPECT_THAT(row.samples.first, testing::ElementsAre(0, 2, 3));
  const auto at = [&](size_t plane, size_t sample) { return row.samples.plane(plane)[sample]; };
  EXPECT_EQ(at(0, 0), 0);
  EXPECT_NEAR(at(4, 0), std::log(1 + 2 * 3.0), 1e-6);
  EXPECT_EQ(at(6, 0), 0.5f);
  EXPECT_EQ(at(9, 0), 0);
  EXPECT_NEAR(at(12, 1), 6 / (6 + scale.depth), 1e-6);
  EXPECT_EQ(at(16, 1), 0.75f);
  EXPECT_EQ(at(17, 1), 0);
  EXPECT_NEAR(at(19, 1), 1 / 8.0, 1e-6);
  EXPECT_EQ(at(nn::kExposedAt + 3 + 2, 0), 6) << "as specular light";
  EXPECT_EQ(at(nn::kExposedAt + 2, 0), 0);
  EXPECT_THAT(scale.lights, testing::ElementsAre(nn::SampleLight::Both));
  EXPECT_EQ(at(nn::kSampleDepth, 2), 4);
}

TEST(LayerSamples, TellWhetherThereAreTwoLights) {
  DeepImage image = reference::makeNoisyFrame(12, 9, 1);
  using nn::SampleLight;
  const auto lights = [&] { return measureLayers(layerSource(image), {}).lights; };
  EXPECT_THAT(lights(), testing::ElementsAre(SampleLight::Diffuse, SampleLight::Specular));
  const std::span<const float> alpha = image.get("A");
  for (const char* c : {"R", "G", "B"}) {
    const std::span<float> specular = image.get(std::string("specular.") + c);
    for (size_t s = 0; s < specular.size(); ++s)
      if (alpha[s] > 0) specular[s] = 0;
  }
  EXPECT_THAT(lights(), testing::ElementsAre(SampleLight::Diffuse));
  const auto seen = size_t(std::ranges::find_if(alpha, [](float a) { return a > 0; }) - alpha.begin());
  image.get("specular.G")[seen] = 1e-30f;
  EXPECT_EQ(lights().size(), 2U);
}

TEST(LayerSamples, OddValues) {
  const float infinity = std::numeric_limits<float>::infinity();
  DeepImage image = reference::makeDeep({{{1, 1, 0, 2}, {2, 2, 0, 2}, {-3, -3, 0.5f, -4}, {4, 4, 1, 1}}}, 1);
  image.add("G", PixelType::Float).values.fill(0);
  for (const char* name : {"variance.R", "variance.G", "variance.B"})
    image.add(name, PixelType::Float).values.fill(infinity);
  for (const char* name : {"coc", "lens.U", "lens.V"}) image.add(name, PixelType::Float).values.fill(-12);
  const LayerSource source = layerSource(image);
  ASSERT_TRUE(source.inputs.coc && source.inputs.lens);
  LayerRow row = layerRow(image, source.inputs, {1, 2}, image.dataWindow.y0);
  ASSERT_EQ(row.samples.count(), 2U);
  const auto at = [&](size_t plane, size_t sample) { return row.samples.plane(plane)[sample]; };
  EXPECT_EQ(row.emissionDepth[0], 1) << "of the first that shines";
  EXPECT_EQ(at(3, 0), 0) << "negative light";
  EXPECT_EQ(at(nn::kExposedAt + 3, 0), -8);
  EXPECT_EQ(at(12, 0), 0) << "behind the camera";
  EXPECT_EQ(at(13, 0), -12.0f / 16);
  EXPECT_EQ(at(14, 0), -1);
  for (const size_t noise : {17u, 18u}) EXPECT_EQ(at(noise, 1), 0) << "unknown variance";
  EXPECT_EQ(row.nonFinite[0], 0u);
  image.get("R")[1] = infinity;
  EXPECT_EQ(layerRow(image, source.inputs, {1, 2, {}}, image.dataWindow.y0).nonFinite[0], 0u) << "emission is left out";
  image.get("R")[3] = infinity;
  EXPECT_EQ(layerRow(image, source.inputs, {1, 2, {}}, image.dataWindow.y0).nonFinite[0], 1u);
  image.get("R")[3] = 1e12f;  // exposed beyond all light
  row = layerRow(image, source.inputs, {1e25f, 2}, image.dataWindow.y0);
  EXPECT_TRUE(std::isfinite(at(3, 1)));
}

using Light = std::array<float, 3>;

void setLight(DeepImage& image, const std::string& prefix, const std::vector<Light>& light) {
  const std::span<const float> alpha = std::as_const(image).get("A");
  for (size_t c = 0; c < 3; ++c) {
    const std::string name = prefix + "RGB"[c];
    Buffer<float>& values = image.find(name) ? image.find(name)->values : image.add(name, PixelType::Float).values;
    for (size_t s = 0; s < light.size(); ++s) values[s] = std::min(alpha[s], 1.0f) * light[s][c];
  }
}

double meanOf(const Light& light) {
  return (double(light[0]) + double(light[1]) + double(light[2])) / 3;
}

TEST(LayerSamples, CameraSamplesDeviateAsTheirPixelDoes) {
  DeepImage image = reference::makeDeep({{{2, 2, 0.25f}, {6, 6, 1}}, {{3, 3, 0.5f}, {5, 5, 1}}, {{4, 4, 1}}}, 3);
  const std::vector<Light> light = {{3, 1, 2}, {0.5f, 0.25f, 0.1f}, {3, 1, 2}, {0, 0, 0}, {1, 2, 3}};
  setLight(image, "", light);
  image.attributes.set("fathom:spp", 4);
  const LayerSource source = layerSource(image);
  ASSERT_TRUE(source.inputs.cameraSamples());
  const double exposure = 0.5;
  const LayerRow row = layerRow(image, source.inputs, {float(exposure), 4}, image.dataWindow.y0);
  const auto expect = [&](size_t sample, size_t first, double share) {
    double squares = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double a = double(light[first][c]), b = double(light[first + 1][c]), mean = share * a + (1 - share) * b;
      squares += (std::pow(share * (a - mean), 2) + std::pow((1 - share) * (b - mean), 2)) / 3;
    }
    const double deviation = std::sqrt(squares / (1 - share * share - (1 - share) * (1 - share)));
    const double relative = exposure * deviation / (exposure * meanOf(light[sample]) + 0.01);
    EXPECT_NEAR(row.samples.plane(18)[sample], std::log1p(std::min(8.0, relative)), 1e-5) << sample;
  };
  expect(0, 0, 0.25);
  expect(1, 0, 0.25);
  expect(2, 2, 0.5);
  expect(3, 2, 0.5);  // black: 8
  EXPECT_EQ(row.samples.plane(18)[4], 0) << "one alone tells nothing";
  EXPECT_NEAR(row.samples.plane(19)[0], std::log2(1 + 0.25 * 4) / 8, 1e-6);
}

TEST(LayerSamples, BinsDeviateByTheirVariances) {
  DeepImage image = reference::makeDeep({{{2, 2, 0.5f}, {6, 6, 1}}}, 1);
  const std::vector<Light> diffuse = {{0.3f, 0.6f, 0.9f}, {1, 1, 1}}, specular = {{1, 2, 3}, {0.1f, 0.1f, 0.1f}},
                           albedo = {{0.2f, 0.4f, 0.6f}, {4, 0.5f, 0.5f}};
  setLight(image, "diffuse.", diffuse);
  setLight(image, "specular.", specular);
  setLight(image, "albedo.", albedo);
  const auto fill = [&](const std::string& name, float first, float second) {
    Buffer<float>& values = image.add(name, PixelType::Float).values;
    values[0] = first, values[1] = second;
  };
  fill("variance.diffuse.R", -1, 0.04f), fill("variance.diffuse.G", 0.5f, 0.04f), fill("variance.diffuse.B", 1, 0.04f);
  for (const char* c : {"R", "G", "B"}) fill(std::string("variance.specular.") + c, 0.25f, 100);
  fill("samples", -3, 7);
  for (const char* c : {"X", "Y", "Z"}) fill(std::string("N.") + c, -0.75f, 3);
  const LayerSource source = layerSource(image);
  const double exposure = 2;
  const LayerRow row =
      layerRow(image, source.inputs, {float(exposure), 4, {}, {nn::SampleLight::Diffuse, nn::SampleLight::Specular}},
               image.dataWindow.y0);
  const auto at = [&](size_t plane, size_t sample) { return row.samples.plane(plane)[sample]; };
  const Light divisors[] = {{0.3f, 0.5f, 0.7f}, {1.1f, 0.6f, 0.6f}};  // an albedo is at most 1
  for (size_t s = 0; s < 2; ++s) {
    Light divided;
    for (size_t c = 0; c < 3; ++c) {
      divided[c] = diffuse[s][c] / divisors[s][c];
      EXPECT_NEAR(at(c, s), std::log1p(exposure * double(divided[c])), 1e-5);
      EXPECT_NEAR(at(6 + c, s), std::min(albedo[s][c], 1.0f), 1e-6);
    }
    const double ofDiffuse = s == 0 ? std::sqrt((0 + 0.5 + 1) / 3) : 0.2, ofSpecular = s == 0 ? 0.5 : 10;
    EXPECT_NEAR(at(17, s),
                std::log1p(exposure * ofDiffuse / (meanOf(divisors[s]) * (exposure * meanOf(divided) + 0.01))), 1e-5);
    EXPECT_NEAR(at(18, s), std::log1p(std::min(8.0, exposure * ofSpecular / (exposure * meanOf(specular[s]) + 0.01))),
                1e-5);
  }
  EXPECT_EQ(at(9, 0), -1) << "a normal is at least -1";
  EXPECT_EQ(at(9, 1), 1) << "and at most 1";
  EXPECT_EQ(at(19, 0), 0) << "less than none";
  EXPECT_NEAR(at(19, 1), 3 / 8.0, 1e-6);
}

TEST(LayerSamples, LightEndsBeforeItsSumsDo) {
  DeepImage image = reference::makeDeep({{{2, 2, 0.5f}, {6, 6, 1}}}, 1);
  setLight(image, "", {{1e12f, -1e12f, 1}, {1, 1, 1}});
  const LayerRow row = layerRow(image, layerSource(image).inputs, {1e25f, 4}, image.dataWindow.y0);
  EXPECT_EQ(row.samples.plane(nn::kExposedAt + 3)[0], 1e30f);
  EXPECT_EQ(row.samples.plane(nn::kExposedAt + 4)[0], -1e30f);
  EXPECT_EQ(row.samples.plane(nn::kExposedAt + 5)[0], 1e25f);
}

TEST(LayerSamples, AnAlphaBeyondOneIsOne) {
  DeepImage image = reference::makeDeep({{{2, 2, 0.5f}, {4, 4, 1.5f}, {6, 6, 1}}}, 1);
  setLight(image, "", {{1, 1, 1}, {3, 3, 3}, {9, 9, 9}});
  const LayerRow row = layerRow(image, layerSource(image).inputs, {2, 4}, image.dataWindow.y0);
  ASSERT_EQ(row.samples.count(), 2u) << "nothing is seen behind it";
  EXPECT_EQ(row.samples.plane(nn::kExposedAt + 3)[1], 6);
  EXPECT_EQ(row.samples.plane(16)[1], 0.5f);
  EXPECT_EQ(row.render[0], 0.5f * 1 + 0.5f * 3);
  for (const char* c : {"R", "G", "B"}) {
    DeepImage bright = image.copy();
    bright.get(c)[1] = 1.2e15f;  // as of alpha 1 no number
    const LayerRow lost = layerRow(bright, layerSource(bright).inputs, {2, 4}, bright.dataWindow.y0);
    EXPECT_EQ(lost.samples.count(), 1u) << c;
    EXPECT_EQ(lost.nonFinite[0], 1u) << c;
  }
}

TEST(LayerSamples, DepthsBehindTheCameraHaveAUnitAllTheSame) {
  DeepImage image = reference::makeDeep({{{-3, -3, 0.5f}, {-2, -2, 1}}}, 1);
  setLight(image, "", {{1, 1, 1}, {3, 3, 3}});
  EXPECT_EQ(measureLayers(layerSource(image), {}).depth, 1);
}

// FATHOM_LAYERS_GOLDEN: see tests/nn/layers_golden_test.cpp.
TEST(LayerSamples, EqualsItsTraining) {
  const char* given = std::getenv("FATHOM_LAYERS_GOLDEN");
  const std::string folder = given ? given : "";
  if (folder.empty() || !std::filesystem::exists(folder + "/layers_golden.safetensors"))
    GTEST_SKIP() << "skipped: FATHOM_LAYERS_GOLDEN names no folder with layers_golden.safetensors";
  const nn::LayersNet net(nn::readWeights(folder + "/layers.safetensors"));
  const nn::WeightFile golden = nn::readWeights(folder + "/layers_golden.safetensors");
  const auto values = [&](const std::string& name) -> const Buffer<float>& { return golden.tensors.at(name).values; };
  const auto& shape = golden.tensors.at("counts").shape;
  DeepImage image;
  image.dataWindow = image.displayWindow = {0, 0, int(shape[1]), int(shape[0])};
  image.offsets = Buffer<uint64_t>(image.pixels() + 1, uint64_t(0));
  for (size_t i = 0; i < image.pixels(); ++i) image.offsets[i + 1] = image.offsets[i] + uint64_t(values("counts")[i]);
  for (const auto& [name, tensor] : golden.tensors)
    if (tensor.values.size() == image.samples() && name != "weight" && !name.starts_with("partition"))
      image.channels.push_back({name, PixelType::Float, tensor.values.copy(), {}});
  const LayerSource source = layerSource(image);
  const LayerScale scale = measureLayers(source, {});
  ASSERT_EQ(scale.lights.size(), 2U);
  EXPECT_NEAR(scale.exposure / values("exposure")[0], 1, 1e-5);
  EXPECT_NEAR(scale.depth / values("depth")[0], 1, 1e-5);
  size_t next = 0;
  for (int y = 0; y < image.dataWindow.y1; ++y) {
    const LayerRow row = layerRow(image, source.inputs, scale, y);
    for (size_t s = 0; s < row.samples.count(); ++s, ++next) {
      for (size_t p = 0; p < nn::kSampleInputs; ++p)
        ASSERT_NEAR(row.samples.plane(p)[s], values("inputs")[next * nn::kSampleInputs + p], 1e-5) << p << ", " << next;
      for (size_t c = 0; c < 6; ++c)
        ASSERT_NEAR(row.samples.plane(nn::kExposedAt + c)[s], values("light")[next * 6 + c], 1e-4) << next;
    }
  }
  EXPECT_EQ(next, image.samples());
  // As camera samples, whose deviation is their pixel's.
  DeepImage plain = image.copy();
  std::erase_if(plain.channels, [](const Channel& channel) {
    return channel.name == "samples" || channel.name.starts_with("variance.");
  });
  plain.attributes.set("fathom:spp", 8);
  const LayerSource camera = layerSource(plain);
  ASSERT_TRUE(camera.inputs.cameraSamples());
  next = 0;
  for (int y = 0; y < image.dataWindow.y1; ++y) {
    const LayerRow row = layerRow(plain, camera.inputs, scale, y);
    for (size_t s = 0; s < row.samples.count(); ++s, ++next)
      for (size_t p = 0; p < nn::kSampleInputs; ++p)
        ASSERT_NEAR(row.samples.plane(p)[s], values("sample_inputs")[next * nn::kSampleInputs + p], 1e-5) << p;
  }
  LayerScale told = scale;
  told.light.emplace(1 / scale.exposure);  // a curve that has seen nothing: all stays as the network makes it
  for (const int layers : {1, 2, 4})
    denoiseLayers(net, {.layers = layers}, source, told, 0, image.dataWindow.y1, [&](const LayeredRows& rows) {
      const flat::Image result = flattenedLayers(rows);
      const Buffer<float>&colour = values("colour" + std::to_string(layers)),
            &alpha = values("alpha" + std::to_string(layers));
      for (size_t c = 0; c < 3; ++c)
        for (size_t i = 0; i < image.pixels(); ++i)
          ASSERT_NEAR(result.planes[c].values[i] * scale.exposure, colour[c * image.pixels() + i], 3e-4) << layers;
      for (size_t i = 0; i < image.pixels(); ++i) ASSERT_NEAR(result.planes[3].values[i], alpha[i], 1e-4);
    });
}

}  // namespace
}  // namespace fathom::deep
