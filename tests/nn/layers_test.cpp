// The layered network against its double-precision twin, bands and tiles against the whole, and threads against one.
#include "nn/layers.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/layers_band.h"
#include "tests/reference/layered.h"

namespace fathom::nn {
namespace {

using reference::LayeredResult;
using reference::LayeredTwin;
using reference::PlainSample;
using reference::PlainSamples;
using reference::PlainWeights;
using reference::randomLayered;
using reference::randomSamples;

constexpr int kTile = 512;
const std::vector<SampleLight> kBoth = {SampleLight::Both}, kApart = {SampleLight::Diffuse, SampleLight::Specular};

WeightFile fileOf(const PlainWeights& weights) {
  return readWeights(reference::safetensors(weights), "random");
}

SampleRow rowOf(const PlainSamples& samples, int y) {
  SampleRow row;
  row.first.push_back(0);
  for (int x = 0; x < samples.width; ++x) row.first.push_back(row.first.back() + uint32_t(samples.at(y, x).size()));
  row.values = Buffer<float>(kSamplePlanes * row.count());
  size_t s = 0;
  for (int x = 0; x < samples.width; ++x)
    for (const PlainSample& sample : samples.at(y, x)) {
      for (size_t p = 0; p < kSampleInputs; ++p) row.plane(p)[s] = float(sample.inputs[p]);
      for (size_t c = 0; c < 6; ++c) row.plane(kExposedAt + c)[s] = float(sample.colour[c]);
      row.plane(kSampleDepth)[s] = float(sample.depth);
      ++s;
    }
  return row;
}

void run(LayersBand& band, const PlainSamples& samples, const Progress& progress = {}) {
  const auto rows = [&](const Interval& interval, const auto& add) {
    parallelFor(interval.begin, interval.end, [&](int y) { add(y, rowOf(samples, y)); });
  };
  rows(band.meanRows(), [&](int y, const SampleRow& row) { band.addMeans(y, row); });
  band.makeContext(progress);
  rows(band.sumRows(), [&](int y, const SampleRow& row) { band.addSums(y, row); });
  band.filter(progress);
}

// [layers][kLayerPlanes][height][width] of a frame in bands of so many rows.
std::vector<float> denoised(const LayersNet& net, const PlainSamples& samples, int layers, int rows = 1 << 20,
                            int tile = kTile, const std::vector<SampleLight>& lights = kBoth) {
  const size_t pixels = size_t(samples.height) * size_t(samples.width);
  std::vector<float> result(size_t(layers) * kLayerPlanes * pixels, -1.0f);
  for (int y0 = 0; y0 < samples.height; y0 += rows) {
    LayersBand band(net, samples.height, samples.width, {y0, std::min(y0 + rows, samples.height)}, layers, lights,
                    tile);
    run(band, samples);
    for (int l = 0; l < layers; ++l)
      for (size_t p = 0; p < kLayerPlanes; ++p)
        for (int y = y0; y < band.rows().end; ++y)
          std::copy_n(band.row(l, p, y), samples.width,
                      result.data() + (size_t(l) * kLayerPlanes + p) * pixels + size_t(y) * size_t(samples.width));
  }
  return result;
}

std::vector<double> valuesOf(const LayeredResult& result) {
  std::vector<double> values;
  for (const reference::Volume& layer : result.layers)
    values.insert(values.end(), layer.values.begin(), layer.values.end());
  return values;
}

template <class T>
double largest(const std::vector<T>& values) {
  double most = 0;
  for (const T v : values) most = std::max(most, std::fabs(double(v)));
  return most;
}

template <class A, class B>
double largestDifference(const std::vector<A>& a, const std::vector<B>& b) {
  EXPECT_EQ(a.size(), b.size());
  double most = 0;
  for (size_t i = 0; i < a.size(); ++i) most = std::max(most, std::fabs(double(a[i]) - double(b[i])));
  return most;
}

TEST(LayersNet, EqualsItsTwin) {
  for (const int width : {16, 32}) {
    const PlainWeights weights = randomLayered(width, 1);
    const LayersNet net(fileOf(weights));
    ASSERT_EQ(net.width(), width);
    for (const auto& [height, length] : {std::pair(4, 4), std::pair(12, 20), std::pair(20, 8)})
      for (const size_t most : {1, 3, 9})
        for (const int layers : {1, 2, 4}) {
          if ((width == 32 || most == 9) && length != 20) continue;
          const PlainSamples samples = randomSamples(height, length, most, 7);
          const std::vector<double> expected = valuesOf(LayeredTwin(weights).denoise(samples, layers));
          const std::vector<float> result = denoised(net, samples, layers);
          EXPECT_LT(largestDifference(result, expected), 1e-4 * largest(expected))
              << width << " wide, " << height << "x" << length << ", up to " << most << " samples, L = " << layers;
        }
  }
}

// More samples in a row than a chunk has.
TEST(LayersNet, EqualsItsTwinForManySamples) {
  const PlainWeights weights = randomLayered(16, 5);
  const PlainSamples samples = randomSamples(4, 8, 400, 3);
  ASSERT_GT(rowOf(samples, 0).count(), 1100U);
  for (const auto& lights : {kBoth, kApart}) {
    const std::vector<double> expected = valuesOf(LayeredTwin(weights).denoise(samples, 2, lights));
    const std::vector<float> result = denoised(LayersNet(fileOf(weights)), samples, 2, 1 << 20, kTile, lights);
    EXPECT_LT(largestDifference(result, expected), 1e-4 * largest(expected)) << lights.size() << " lights";
  }
}

TEST(LayersNet, DenoisesLightsApart) {
  const PlainWeights weights = randomLayered(16, 6);
  const LayersNet net(fileOf(weights));
  const PlainSamples samples = randomSamples(20, 36, 5, 8);
  for (const int layers : {1, 2, 4}) {
    const std::vector<double> expected = valuesOf(LayeredTwin(weights).denoise(samples, layers, kApart));
    const std::vector<float> result = denoised(net, samples, layers, 1 << 20, kTile, kApart);
    EXPECT_LT(largestDifference(result, expected), 1e-4 * largest(expected)) << "L = " << layers;
    EXPECT_GT(largestDifference(result, denoised(net, samples, layers)), 1e-3 * largest(expected));
    EXPECT_LT(largestDifference(denoised(net, samples, layers, 8, 8, kApart), expected), 1e-4 * largest(expected));
  }
}

// Weights that come to more than all of a pixel, as rounded ones may: nothing is left, but not less.
TEST(LayersNet, EqualsItsTwinWherePixelsAreMoreThanFull) {
  const PlainWeights weights = randomLayered(16, 2);
  const LayersNet net(fileOf(weights));
  PlainSamples samples = randomSamples(12, 20, 4, 9);
  for (size_t pixel = 0; pixel < samples.pixels.size(); pixel += 2)
    for (PlainSample& sample : samples.pixels[pixel]) sample.inputs[16] *= 1.5;
  for (const int layers : {1, 2, 4}) {
    const std::vector<double> expected = valuesOf(LayeredTwin(weights).denoise(samples, layers));
    EXPECT_LT(largestDifference(denoised(net, samples, layers), expected), 1e-4 * largest(expected))
        << "L = " << layers;
  }
}

TEST(LayersNet, IsCloseInBfloat16) {
  if (!machineHasBfloat16()) GTEST_SKIP() << "skipped: no bfloat16 on this processor";
  const PlainWeights weights = randomLayered(16, 1);
  const LayersNet net(fileOf(weights), Precision::bfloat16);
  const PlainSamples samples = randomSamples(20, 24, 4, 7);
  for (const int layers : {1, 2, 4}) {
    const std::vector<double> expected = valuesOf(LayeredTwin(weights).denoise(samples, layers));
    const std::vector<float> result = denoised(net, samples, layers);
    EXPECT_LT(largestDifference(result, expected), 0.05 * largest(expected));
    EXPECT_GT(largestDifference(result, expected), 1e-5 * largest(expected));
  }
}

TEST(LayersNet, TellsTheShares) {
  const PlainWeights weights = randomLayered(16, 2);
  const LayersNet net(fileOf(weights));
  const PlainSamples samples = randomSamples(8, 12, 5, 4);
  const LayeredResult expected = LayeredTwin(weights).denoise(samples, 4);
  LayersBand band(net, 8, 12, {0, 8}, 4, kBoth, kTile);
  run(band, samples);
  size_t first = 0;
  for (int y = 0; y < 8; ++y) {
    const SampleRow row = rowOf(samples, y);
    const Buffer<float> shares = band.shares(y, row);
    for (size_t s = 0; s < row.count(); ++s)
      for (size_t l = 0; l < 4; ++l) ASSERT_NEAR(shares[l * row.count() + s], expected.shares[first + s][l], 1e-4);
    first += row.count();
  }
}

TEST(LayersBand, KeepsAColourThatIsTheSameEverywhere) {
  // Opaque pixels, all of one colour: the layers add up to it, whatever the network says.
  const LayersNet net(fileOf(randomLayered(16, 3)));
  PlainSamples samples = randomSamples(16, 16, 4, 5);
  for (std::vector<PlainSample>& pixel : samples.pixels) {
    if (pixel.empty()) pixel = {{std::vector<double>(20, 0.25), {}, 1}};
    double sum = 0;
    for (const PlainSample& sample : pixel) sum += sample.weight();
    for (PlainSample& sample : pixel) {
      sample.inputs[16] /= sum;
      for (double& c : sample.colour) c = 0.35;
    }
  }
  const std::vector<float> one = denoised(net, samples, 1);
  for (size_t i = 0; i < 3 * 256; ++i) ASSERT_NEAR(one[i], 0.7, 1e-5);
  for (size_t i = 3 * 256; i < 4 * 256; ++i) ASSERT_NEAR(one[i], 1, 1e-6);
  const std::vector<float> two = denoised(net, samples, 2);
  for (size_t i = 0; i < 3 * 256; ++i) {
    const size_t pixel = i % 256;
    // A layer's colour is in proportion to its alpha.
    ASSERT_NEAR(two[i], 0.7 * two[3 * 256 + pixel], 1e-5);
    ASSERT_NEAR(two[5 * 256 + i], 0.7 * two[8 * 256 + pixel], 1e-5);
  }
}

TEST(LayersBand, TilesAndBandsEqualTheWhole) {
  const LayersNet net(fileOf(randomLayered(16, 4)));
  const PlainSamples samples = randomSamples(96, 132, 3, 9);
  for (const int layers : {1, 2, 4}) {
    const std::vector<float> expected = denoised(net, samples, layers);
    for (const auto& [rows, tile] : {std::pair(96, 64), std::pair(64, 512), std::pair(36, 64), std::pair(4, 512)}) {
      if (rows == 4 && layers != 2) continue;
      EXPECT_LT(largestDifference(denoised(net, samples, layers, rows, tile), expected), 1e-5 * largest(expected))
          << "L = " << layers << ", bands of " << rows << ", tiles of " << tile;
    }
  }
}

TEST(LayersBand, IsTheSameForAnyNumberOfThreads) {
  const LayersNet net(fileOf(randomLayered(16, 4)));
  const PlainSamples samples = randomSamples(96, 132, 3, 9);
  std::vector<float> results[2];
  for (const size_t threads : {1, 2}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    results[threads - 1] = denoised(net, samples, 2, 48, 64);
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], denoised(net, samples, 2, 48, 64));
}

// Samples in opposite corners of a frame: far from them nothing runs, and the answer is that of the twin, which runs everywhere.
TEST(LayersBand, SkipsWhatIsEmptyWithTheSameAnswer) {
  const PlainWeights weights = randomLayered(16, 4);
  const LayersNet net(fileOf(weights));
  for (const bool first : {true, false}) {
    PlainSamples samples = randomSamples(64, 128, 3, 9);
    for (int y = 0; y < samples.height; ++y)
      for (int x = 0; x < samples.width; ++x)
        if (first ? y >= 20 || x >= 29 : y < 44 || x < 99) samples.at(y, x).clear();
    LayersBand band(net, 64, 128, {0, 64}, 2, kBoth, 32);
    run(band, samples);
    EXPECT_EQ(band.filtered() + band.skipped(), 2U * 2 * 4);
    EXPECT_EQ(band.filtered(), 2U * 2);  // the corner's tile, and its neighbour, which the filter reaches from there
    const std::vector<double> expected = valuesOf(LayeredTwin(weights).denoise(samples, 2));
    const std::vector<float> result = denoised(net, samples, 2, 64, 32);
    EXPECT_LT(largestDifference(result, expected), 1e-4 * largest(expected));
    EXPECT_LT(largestDifference(result, denoised(net, samples, 2)), 1e-5 * largest(expected));
  }
}

// A partition that puts everything into the second layer leaves the first exactly empty.
TEST(LayersBand, SkipsAnEmptyLayer) {
  PlainWeights weights = randomLayered(16, 4);
  weights.tensors["partition.2.bias"].values = {-40, 40, 0, 0};
  const LayersNet net(fileOf(weights));
  const PlainSamples samples = randomSamples(32, 32, 3, 9);
  LayersBand band(net, 32, 32, {0, 32}, 2, kBoth, kTile);
  run(band, samples);
  EXPECT_EQ(band.filtered(), 1U);
  EXPECT_EQ(band.skipped(), 1U);
  const std::vector<float> two = denoised(net, samples, 2), one = denoised(net, samples, 1);
  for (size_t i = 0; i < one.size(); ++i) {
    ASSERT_EQ(two[i], 0);
    ASSERT_NEAR(two[one.size() + i], one[i], 1e-5 * largest(one));
  }
}

TEST(LayersBand, ReportsAndStops) {
  const LayersNet net(fileOf(randomLayered(16, 4)));
  const PlainSamples samples = randomSamples(64, 128, 2, 9);
  LayersBand band(net, 64, 128, {0, 64}, 2, kBoth, 64);
  double last = 0;
  Progress progress;
  progress.report = [&](double done) { last = done; };
  run(band, samples, progress);
  EXPECT_DOUBLE_EQ(last, 1);
  std::stop_source source;
  source.request_stop();
  LayersBand other(net, 64, 128, {0, 64}, 2, kBoth, 64);
  EXPECT_THROW(run(other, samples, {{}, source.get_token()}), Cancelled);
}

// Weights with which every 3x3 convolution shifts by a pixel, so that what is far away counts most.
PlainWeights shifting(bool left) {
  PlainWeights weights = randomLayered(16, 2);
  for (auto& [name, tensor] : weights.tensors) {
    if (!name.ends_with(".weight")) continue;
    const int width = int(tensor.shape[3]);
    for (size_t i = 0; i < tensor.values.size(); ++i) {
      const bool kept = width < 3 || int(i) % width == (left ? 2 : 0);
      const float fan = float(tensor.shape[1] * width);
      tensor.values[i] = kept ? (0.5f + std::fabs(tensor.values[i])) / fan : 0.0f;
    }
  }
  // Kernels that differ: where all logits are alike, none would matter.
  for (int i = 0; i < 3; ++i) {
    std::vector<float>& last = weights.tensors["kernel" + std::to_string(i) + ".2.weight"].values;
    for (size_t k = 0; k < last.size(); ++k) last[k] *= (k / 32) % 2 ? 1.0f : -1.0f;
  }
  return weights;
}

TEST(LayersNet, HaloIsWhatTheOutputDependsOn) {
  constexpr int kHeight = 4, kWidth = 160, kAt = 80;
  const PlainSamples samples = randomSamples(kHeight, kWidth, 2, 3);
  int reached = 0, halo = 0;
  for (const bool left : {false, true}) {
    const LayersNet net(fileOf(shifting(left)));
    halo = net.filterHalo() + net.contextHalo();
    const std::vector<float> before = denoised(net, samples, 1);
    for (int at = kAt; at < kAt + 4; ++at) {
      PlainSamples changed = samples;
      changed.at(1, at) = {{std::vector<double>(20, 30), {5, 5, 5}, 3}};
      changed.at(1, at)[0].inputs[16] = 1;
      const std::vector<float> after = denoised(net, changed, 1);
      for (size_t i = 0; i < after.size(); ++i) {
        const int x = int(i % kWidth), tile = x - x % LayersNet::kAlignment;
        if (before[i] != after[i]) reached = std::max({reached, tile - at, at - (tile + LayersNet::kAlignment - 1)});
      }
    }
    EXPECT_GE(net.meanHalo(), net.contextHalo());
    EXPECT_EQ(net.halo() % LayersNet::kAlignment, 0);
  }
  EXPECT_LE(reached, halo);
  EXPECT_GT(reached, halo - 8);  // both steps round up
}

TEST(LayersNet, CountsItsArithmetic) {
  const LayersNet net(fileOf(randomLayered(16, 1)));
  const double reducer = 20 * 32 + 2 * 32 * 32, partition = 32 * 32 + 32 * 16 + 16 * 4;
  const double unet = 32 * 16 * 9 + 2 * 16 * 16 * 9 + 16 * 32 * 4 / 4.0 + 2 * 32 * 32 * 9 / 4.0 + 32 * 64 * 4 / 16.0 +
                      2 * 64 * 64 * 9 / 16.0 + 64 * 32 / 16.0 + 64 * 32 * 9 / 4.0 + 32 * 16 / 4.0 + 32 * 16 * 9;
  const double context = 16 * 32 + 16 * 32 + 32 * 32 / 4.0 + 64 * 32 / 16.0;
  const double layer = 2 * 32 * 32 * (1 + 1 / 4.0 + 1 / 16.0) + 32 * 28 + 32 * 25 * (1 / 4.0 + 1 / 16.0) +
                       25 * 6 * (1 + 1 / 4.0 + 1 / 16.0);
  EXPECT_DOUBLE_EQ(net.flopPerPixel(0, 1), 2 * (unet + context + layer));
  EXPECT_DOUBLE_EQ(net.flopPerPixel(8, 1), 2 * (8 * 2 * reducer + unet + context + layer));
  EXPECT_DOUBLE_EQ(net.flopPerPixel(8, 4), 2 * (8 * (2 * reducer + partition) + unet + context + 4 * layer));
  const double division = 25 * 6 * (1 + 1 / 4.0 + 1 / 16.0);
  EXPECT_DOUBLE_EQ(net.flopPerPixel(8, 4, 2),
                   2 * (8 * (4 * reducer + partition) + 2 * (unet + context + 4 * layer) + 4 * division));
}

TEST(LayersNet, RefusesOtherFiles) {
  const auto message = [](const auto& change) {
    PlainWeights weights = randomLayered(16, 1);
    change(weights);
    try {
      const LayersNet net(fileOf(weights));
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  EXPECT_EQ(message([](PlainWeights&) {}), "accepted");
  EXPECT_EQ(message([](PlainWeights& w) { w.metadata["format"] = "fathom-compositional"; }),
            "random, metadata format: expected fathom-layers, found fathom-compositional");
  EXPECT_EQ(message([](PlainWeights& w) { w.metadata["version"] = "2"; }),
            "random, metadata version: expected 1, found 2");
  EXPECT_EQ(message([](PlainWeights& w) { w.metadata.erase("embedding"); }), "random: metadata embedding is missing");
  EXPECT_EQ(message([](PlainWeights& w) { w.metadata["inputs"] = "24"; }),
            "random, metadata inputs: expected 20, found 24");
  EXPECT_EQ(message([](PlainWeights& w) { w.metadata["width"] = "24"; }),
            "random, metadata width: expected a multiple of 16 up to 256, found 24");
  EXPECT_EQ(message([](PlainWeights& w) { w.metadata["width"] = "32"; }),
            "random, tensor unet.in.weight: expected shape 32x32x3x3, found 16x32x3x3");
  EXPECT_EQ(message([](PlainWeights& w) { w.tensors.erase("kernel0.2.bias"); }),
            "random: tensor kernel0.2.bias is missing");
  EXPECT_EQ(message([](PlainWeights& w) {
              w.tensors["kernel1.embedding.bias"] = {{32}, std::vector<float>(32)};
            }),
            "random, tensor kernel1.embedding.bias: no layer takes it");
}

}  // namespace
}  // namespace fathom::nn
