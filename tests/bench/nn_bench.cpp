// The compositional network with random weights: its rate against that of oneDNN's convolutions alone, and what a
// megapixel costs.
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <map>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/tiles.h"
#include "tests/bench/measure.h"
#include "tests/reference/compositional.h"

namespace fathom::bench {
namespace {

using nn::CompositionalNet;
using nn::Precision;

constexpr int kRepeats = 5;
constexpr int kTile = 192;
constexpr int kFrame = 1536;
constexpr int kComponents[] = {1, 2, 4};

struct Setting {
  int width;
  Precision precision;

  std::string name() const {
    return fmt::format("{}, {}", width, precision == Precision::float32 ? "float32" : "bfloat16");
  }
  CompositionalNet net() const {
    const auto bytes = reference::safetensors(reference::randomCompositional(width, 1));
    return CompositionalNet(nn::readWeights(bytes, "random"), precision);
  }
};

std::vector<Setting> settings() {
  std::vector<Setting> result = {{16, Precision::float32}, {32, Precision::float32}};
  if (nn::machineHasBfloat16()) result.insert(result.end(), {{16, Precision::bfloat16}, {32, Precision::bfloat16}});
  return result;
}

struct Frame {
  std::vector<float> planes, colour, out;
  nn::CompositionalInput input;
  nn::Planes result;

  explicit Frame(int side)
      : planes(floatsOf(reference::randomVolume(nn::kInputPlanes, side, side, 1, -1, 1))),
        colour(floatsOf(reference::randomVolume(3, side, side, 2, 0, 2))),
        out(colour.size()),
        input{nn::denseRows<const float>(planes.data(), nn::kInputPlanes, side, side),
              nn::denseRows<const float>(colour.data(), 3, side, side), side, side},
        result(nn::denseRows(out.data(), 3, side, side)) {}
  Frame(const Frame&) = delete;
  Frame& operator=(const Frame&) = delete;
};

// The convolutions of one module, each run by itself a few times over.
class Layers {
 public:
  static constexpr int kRuns = 3;

  explicit Layers(const nn::Module& module) : module_(module), plan_(module.plan(kTile, kTile)) {
    arena_ = Buffer<std::byte>(plan_->layout().bytes, std::byte(0));
    for (const nn::Value input : module.graph().inputs()) {
      inputs_.emplace_back(bytesOf(module.graph().info(input), module.sizes(), kTile, kTile), std::byte(0));
      pointers_.push_back(inputs_.back().data());
    }
  }

  void run() {
    const auto& layers = module_.graph().layers();
    for (size_t i = 0; i < layers.size(); ++i)
      for (int k = 0; k < kRuns && layers[i].kind == nn::Graph::Kind::conv; ++k)
        plan_->runLayer(i, pointers_, arena_.data());
  }

 private:
  const nn::Module& module_;
  std::shared_ptr<const nn::Plan> plan_;
  Buffer<std::byte> arena_;
  std::vector<Buffer<std::byte>> inputs_;
  std::vector<const std::byte*> pointers_;
};

// Every thread has a tile of its own, without borders: the arithmetic is that of the layers, and no more.
Table rates() {
  const int threads = tbb::this_task_arena::max_concurrency();
  Table table(fmt::format("Network and oneDNN's convolutions alone, {0}x{0} pixels, {1} threads", kTile, threads),
              {"width", "components", "network GFLOP/s", "convolutions GFLOP/s", "share"});
  for (const Setting& setting : settings()) {
    const CompositionalNet net = setting.net();
    std::vector<std::unique_ptr<Frame>> frames;
    std::vector<CompositionalNet::Workspace> workspaces(static_cast<size_t>(threads));
    std::vector<std::vector<Layers>> modules(3);
    for (int t = 0; t < threads; ++t) {
      frames.push_back(std::make_unique<Frame>(kTile));
      for (size_t m = 0; m < 3; ++m)
        modules[m].emplace_back(m == 0 ? net.encoder() : m == 1 ? net.decompose() : net.denoiser());
    }
    std::vector<std::function<void()>> cases;
    for (std::vector<Layers>& layers : modules)
      cases.emplace_back([&] { parallelFor(0, threads, [&](int t) { layers[size_t(t)].run(); }); });
    for (const int components : kComponents)
      cases.emplace_back([&, components] {
        parallelFor(0, threads, [&](int t) {
          Frame& frame = *frames[size_t(t)];
          net.denoise(frame.input, {0, 0, kTile, kTile}, components, frame.result, workspaces[size_t(t)]);
        });
      });
    const std::vector<double> seconds = interleavedMedians(cases, kRepeats);
    for (size_t i = 0; i < 3; ++i) {
      const int k = kComponents[i];
      const double flop = net.flopPerPixel(k) * kTile * kTile * threads;
      const double alone = (seconds[0] + (k - 1) * seconds[1] + k * seconds[2]) / Layers::kRuns;
      table.add({setting.name(), double(k), flop / seconds[3 + i] * 1e-9, flop / alone * 1e-9, alone / seconds[3 + i]});
    }
  }
  return table;
}

Table costs() {
  Table table(
      fmt::format("A frame of {0}x{0} pixels in tiles, {1} threads", kFrame, tbb::this_task_arena::max_concurrency()),
      {"width", "components", "s/MP", "MB/MP", "kFLOP per pixel", "halo", "bytes per pixel of a tile"});
  Frame frame(kFrame);
  const double megapixels = kFrame * kFrame * 1e-6;
  for (const Setting& setting : settings()) {
    const CompositionalNet net = setting.net();
    std::vector<std::function<void()>> cases;
    std::vector<double> memory;
    for (const int k : kComponents) {
      cases.emplace_back([&, k] {
        denoiseTiles(net, frame.input, planTiles(net, kFrame, kFrame, {.least = k, .most = k}), frame.result);
      });
      memory.push_back(double(peakGrowth(cases.back())));
    }
    const std::vector<double> seconds = interleavedMedians(cases, 1);
    for (size_t i = 0; i < cases.size(); ++i) {
      const int k = kComponents[i];
      table.add({setting.name(), double(k), seconds[i] / megapixels, memory[i] * 1e-6 / megapixels,
                 net.flopPerPixel(k) * 1e-3, double(net.halo(k)), net.bytesPerPixel(k)});
    }
  }
  return table;
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) {
  using namespace fathom::bench;
  try {
    const std::map<std::string, Table (*)()> all = {{"costs", costs}, {"rates", rates}};
    const std::string named = argc == 4 ? argv[3] : "";
    if (argc < 3 || argc > 4 || (!named.empty() && !all.contains(named)))
      fathom::fail("usage: bench_nn FOLDER_OF_FRAMES OUTPUT_FOLDER [rates|costs]");
    std::vector<Table> tables;
    for (const auto& [name, make] : all)
      if (named.empty() || name == named) tables.push_back(make());
    for (const Table& table : tables) table.print();
    writeJson(std::string(argv[2]) + "/nn.json", tables);
  } catch (const std::exception& e) {
    fmt::print(stderr, "bench_nn: {}\n", e.what());
    return 1;
  }
}
