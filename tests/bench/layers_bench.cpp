// The layered network with random weights: what a megapixel of 8 samples a pixel costs, and which step takes it.
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <random>

#include "base/error.h"
#include "base/parallel.h"
#include "cli/stopwatch.h"
#include "nn/layers_band.h"
#include "tests/bench/measure.h"
#include "tests/reference/layered.h"

namespace fathom::bench {
namespace {

using nn::LayersBand;
using nn::LayersNet;
using nn::Precision;

constexpr int kSide = 512, kSamples = 8, kTile = 256, kRepeats = 3;
constexpr int kLayers[] = {1, 2, 4}, kLights[] = {1, 2};

// Camera samples: all weigh the same.
nn::SampleRow randomRow(uint32_t seed) {
  std::mt19937 generator(seed);
  nn::SampleRow row;
  for (int x = 0; x <= kSide; ++x) row.first.push_back(uint32_t(x * kSamples));
  row.values = Buffer<float>(nn::kSamplePlanes * row.count());
  for (float& v : row.values) v = float(generator()) / 4294967296.0f;
  std::fill_n(row.plane(nn::kWeightInput), row.count(), 1.0f / kSamples);
  return row;
}

// Runs one frame; seconds of its four steps are added to `steps`.
void runFrame(const LayersNet& net, const std::vector<nn::SampleRow>& rows, int layers, int lights, double* steps) {
  using enum nn::SampleLight;
  const std::vector<nn::SampleLight> one = {Both}, two = {Diffuse, Specular};
  LayersBand band(net, kSide, kSide, {0, kSide}, layers, lights == 1 ? one : two, kTile);
  const std::vector<std::function<void()>> parts = {
      [&] { parallelFor(0, kSide, [&](int y) { band.addMeans(y, rows[size_t(y)]); }); }, [&] { band.makeContext(); },
      [&] { parallelFor(0, kSide, [&](int y) { band.addSums(y, rows[size_t(y)]); }); }, [&] { band.filter(); }};
  for (size_t i = 0; i < parts.size(); ++i) {
    const cli::Stopwatch watch;
    parts[i]();
    steps[i] += watch.seconds();
  }
}

Table costs(const std::vector<nn::SampleRow>& rows) {
  Table table(fmt::format("Layered network, {0}x{0} pixels of {1} samples in tiles of {2}, {3} threads", kSide,
                          kSamples, kTile, tbb::this_task_arena::max_concurrency()),
              {"width", "layers", "lights", "s/MP", "means", "context", "sums", "filter", "GFLOP/MP", "GFLOP/s",
               "bytes per pixel"});
  const double megapixels = kSide * kSide * 1e-6;
  std::vector<std::pair<int, Precision>> settings = {{16, Precision::float32}, {32, Precision::float32}};
  if (nn::machineHasBfloat16()) settings.emplace_back(32, Precision::bfloat16);
  for (const auto& [width, precision] : settings) {
    const auto bytes = reference::safetensors(reference::randomLayered(width, 1));
    const LayersNet net(nn::readWeights(bytes, "random"), precision);
    const std::string name = fmt::format("{}, {}", width, precision == Precision::float32 ? "float32" : "bfloat16");
    for (const int layers : kLayers)
      for (const int lights : kLights) {
        double steps[4] = {};
        runFrame(net, rows, layers, lights, steps);  // plans are made, memory is touched
        std::fill_n(steps, 4, 0.0);
        for (int i = 0; i < kRepeats; ++i) runFrame(net, rows, layers, lights, steps);
        double seconds = 0;
        for (double& step : steps) seconds += step /= kRepeats * megapixels;
        const double gflop = net.flopPerPixel(kSamples, layers, lights) * 1e-3;
        table.add({name, double(layers), double(lights), seconds, steps[0], steps[1], steps[2], steps[3], gflop,
                   gflop / seconds, net.bandBytes(layers, lights)});
      }
  }
  return table;
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) {
  try {
    if (argc != 3) fathom::fail("usage: bench_layers FOLDER_OF_FRAMES OUTPUT_FOLDER");
    std::vector<fathom::nn::SampleRow> rows;
    for (int y = 0; y < fathom::bench::kSide; ++y) rows.push_back(fathom::bench::randomRow(uint32_t(y)));
    const fathom::bench::Table table = fathom::bench::costs(rows);
    table.print();
    fathom::bench::writeJson(std::string(argv[2]) + "/layers.json", {table});
  } catch (const std::exception& e) {
    fmt::print(stderr, "bench_layers: {}\n", e.what());
    return 1;
  }
}
