// The layered network against what training's own program computed with the same weights and samples.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "nn/layers_band.h"

namespace fathom::nn {
namespace {

// A row of the golden file's lists, in which every sample has a say.
SampleRow rowOf(const WeightFile& golden, size_t firstPixel, int width, size_t& next) {
  const Buffer<float>&counts = golden.tensors.at("counts").values, &inputs = golden.tensors.at("inputs").values,
        &light = golden.tensors.at("light").values, &z = golden.tensors.at("Z").values;
  SampleRow row;
  row.first.push_back(0);
  for (int x = 0; x < width; ++x) row.first.push_back(row.first.back() + uint32_t(counts[firstPixel + size_t(x)]));
  row.values = Buffer<float>(kSamplePlanes * row.count());
  for (size_t s = 0; s < row.count(); ++s, ++next) {
    for (size_t p = 0; p < kSampleInputs; ++p) row.plane(p)[s] = inputs[next * kSampleInputs + p];
    for (size_t c = 0; c < 6; ++c) row.plane(kExposedAt + c)[s] = light[next * 6 + c];
    row.plane(kSampleDepth)[s] = z[next];
  }
  return row;
}

void expectNear(const LayersBand& band, size_t plane, int layer, const Buffer<float>& expected, size_t first,
                int height, int width) {
  float most = 0;
  for (const float v : expected) most = std::max(most, std::fabs(v));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      ASSERT_NEAR(band.row(layer, plane, y)[x], expected[first + size_t(y * width + x)], 1e-4f * most)
          << "layer " << layer << ", plane " << plane << ", " << x << ", " << y;
}

// FATHOM_LAYERS_GOLDEN: a folder with layers.safetensors, the weights, and layers_golden.safetensors, as
// nn/train/golden_layers.py writes it.
TEST(LayersNet, EqualsItsTraining) {
  const char* given = std::getenv("FATHOM_LAYERS_GOLDEN");
  const std::string folder = given ? given : "";
  if (folder.empty() || !std::filesystem::exists(folder + "/layers_golden.safetensors"))
    GTEST_SKIP() << "skipped: FATHOM_LAYERS_GOLDEN names no folder with layers_golden.safetensors";
  const LayersNet net(readWeights(folder + "/layers.safetensors"));
  const WeightFile golden = readWeights(folder + "/layers_golden.safetensors");
  const Tensor& counts = golden.tensors.at("counts");
  const int height = int(counts.shape.at(0)), width = int(counts.shape.at(1));
  const auto padded = [](int side) { return (side + 3) / 4 * 4; };
  for (const int layers : {1, 2, 4}) {
    LayersBand band(net, padded(height), padded(width), {0, padded(height)}, layers,
                    {SampleLight::Diffuse, SampleLight::Specular}, 512);
    const auto forRows = [&](const auto& add) {
      size_t next = 0;
      for (int y = 0; y < height; ++y) add(y, rowOf(golden, size_t(y) * size_t(width), width, next));
      ASSERT_EQ(next, golden.tensors.at("weight").values.size());
    };
    forRows([&](int y, const SampleRow& row) { band.addMeans(y, row); });
    band.makeContext();
    size_t sample = 0;
    const Buffer<float>& partition = golden.tensors.at("partition" + std::to_string(layers)).values;
    forRows([&](int y, const SampleRow& row) {
      band.addSums(y, row);
      const Buffer<float> shares = band.shares(y, row);
      for (size_t s = 0; s < row.count(); ++s, ++sample)
        for (size_t l = 0; l < size_t(layers); ++l)
          ASSERT_NEAR(shares[l * row.count() + s], partition[sample * size_t(layers) + l], 1e-4f);
    });
    band.filter();
    const size_t pixels = size_t(height) * size_t(width);
    for (int l = 0; l < layers; ++l) {
      for (size_t c = 0; c < 3; ++c)
        expectNear(band, c, l, golden.tensors.at("radiance" + std::to_string(layers)).values,
                   (size_t(l) * 3 + c) * pixels, height, width);
      expectNear(band, 3, l, golden.tensors.at("opacity" + std::to_string(layers)).values, size_t(l) * pixels, height,
                 width);
      expectNear(band, 4, l, golden.tensors.at("depth" + std::to_string(layers)).values, size_t(l) * pixels, height,
                 width);
    }
  }
}

}  // namespace
}  // namespace fathom::nn
