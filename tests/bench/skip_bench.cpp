// What is saved where a frame needs less: frames of which a part is empty or has converged, each method in turn.
//
// Seconds are the CPU's, as others may be at work on the machine. A network's tiles reach over their border and all methods look
// at the whole frame once, so that the last few per cent are never saved.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/error.h"
#include "cli/model_files.h"
#include "deep/base_guide.h"
#include "deep/flat_nl_means.h"
#include "deep/flat_noisy.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "deep/layers_results.h"
#include "flat/gate.h"
#include "flat/neural.h"
#include "tests/bench/frames.h"
#include "tests/bench/measure.h"

namespace fathom::bench {
namespace {

constexpr int kWidth = 1280, kHeight = 800, kRepeats = 3;
constexpr double kShares[] = {0.5, 0.1, 0.01};  // that are kept noisy
constexpr int kReach = 80;                      // pixels: more than any method's

struct Frame {
  std::string name;
  double skipped;  // share of the pixels
  Box kept;
  deep::DeepImage bins;
  flat::Image pixels;
};

using Method = std::function<flat::Image(const Frame&)>;

deep::DenoiseInputs inputsOf(const deep::DeepImage& image) {
  std::vector<std::string> names;
  for (const deep::Channel& channel : image.channels) names.push_back(channel.name);
  return findDenoiseInputs(names, image.attributes);
}

std::vector<Frame> framesOf(const deep::DeepImage& render) {
  deep::DeepImage whole = tiled(render, kWidth, kHeight);
  const flat::Image pixels = flattenNoisy(whole, inputsOf(whole));
  const Box& window = whole.dataWindow;
  std::vector<Frame> frames;
  for (const auto& [rest, word] : {std::pair(Rest::empty, "empty"), std::pair(Rest::converged, "converged")})
    for (const double share : kShares) {
      const Box kept = middleOf(window, share);
      frames.push_back({fmt::format("{:.0f} % {}", 100 * (1 - share), word),
                        1 - double(kept.area()) / double(window.area()), kept, keepNoisy(whole, kept, rest),
                        keepNoisy(pixels, kept, rest)});
    }
  frames.insert(frames.begin(), {"all noisy", 0, window, std::move(whole), pixels.copy()});
  return frames;
}

flat::Image nlMeans(const Frame& frame) {
  const deep::DenoisePlan plan{inputsOf(frame.bins), {}, meanLevel(frame.bins)};
  return deep::flatten(deep::denoise(frame.bins.copy(), plan));
}

flat::Image flatNlMeansOf(const Frame& frame) {
  return deep::flatNlMeans(deep::planFlat(frame.pixels, {}))(frame.pixels, {});
}

Method network(const std::string& model) {
  return [net = cli::loadModel(model).net](const Frame& frame) {
    return flat::denoiseNeural(*net, {.components = 1}, frame.pixels);
  };
}

// As `fathom denoise` does where Open Image Denoise is not found.
flat::Image guided(const Frame& frame) {
  static const std::shared_ptr<const nn::CompositionalNet> net = cli::loadModel("base").net;
  deep::DenoisePlan plan{inputsOf(frame.bins), {}, meanLevel(frame.bins)};
  plan.guided = true;
  const flat::Denoiser denoiser = flat::withGate(flat::neural(net, {.components = 1}));
  const deep::BaseGuide guide =
      makeGuide(guideInput(frame.bins, plan, true), {denoiser, denoiser, deep::kNetworkGuide}, plan);
  return deep::flatten(deep::denoise(frame.bins.copy(), plan, {}, nullptr, &guide));
}

// Skips what is empty alone: it does not ask for the noise.
Method layers() {
  return [net = cli::loadLayersModel(cli::kLayersModel).net](const Frame& frame) {
    const deep::LayerSource source = deep::layerSource(frame.bins);
    std::optional<flat::Image> result;
    deep::denoiseLayers(*net, {}, source, measureLayers(source, {}), 0, kHeight,
                        [&](const deep::LayeredRows& rows) { result = flattenedLayers(rows); });
    return std::move(*result);
  };
}

// Where the noise stayed, away from the border: the root mean square of how far R, G and B are from another result's, over
// that of these.
double difference(const flat::Image& image, const flat::Image& whole, const Box& kept) {
  double off = 0, all = 0;
  for (const char* name : {"R", "G", "B"})
    for (int y = kept.y0 + kReach; y < kept.y1 - kReach; ++y)
      for (int x = kept.x0 + kReach; x < kept.x1 - kReach; ++x) {
        const size_t i = size_t(y) * kWidth + size_t(x);
        const double a = image.get(name).values[i], b = whole.get(name).values[i];
        off += (a - b) * (a - b), all += b * b;
      }
  return std::sqrt(off / all);
}

Table measured(const std::string& name, const Method& method, const std::vector<Frame>& frames) {
  Table table(name, {"frame", "CPU s/MP", "skipped", "saved", "saved / skipped", "difference where noisy"});
  std::vector<flat::Image> results(frames.size());
  std::vector<std::function<void()>> cases;
  for (size_t i = 0; i < frames.size(); ++i) cases.emplace_back([&, i] { results[i] = method(frames[i]); });
  const std::vector<double> seconds = interleavedMedians(cases, kRepeats, Clock::cpu);
  for (size_t i = 0; i < frames.size(); ++i) {
    const Frame& frame = frames[i];
    const double saved = 1 - seconds[i] / seconds[0];
    const bool inside = frame.kept.width() > 2 * kReach && frame.kept.height() > 2 * kReach;
    table.add({frame.name, seconds[i] / (kWidth * kHeight * 1e-6), frame.skipped, saved,
               frame.skipped > 0 ? Cell(saved / frame.skipped) : Cell("-"),
               inside ? Cell(difference(results[i], results[0], frame.kept)) : Cell("-")});
  }
  return table;
}

void run(const std::string& folder, const std::string& output, const std::string& only) {
  const std::vector<Frame> frames = framesOf(deep::read(folder + "/sequence.0001.deep.exr"));
  const std::pair<const char*, Method> methods[] = {
      {"Bins, NL-Means (balanced)", nlMeans},           {"Bins, guided by base (balanced)", guided},
      {"Pixels, NL-Means (balanced)", flatNlMeansOf},   {"Pixels, network small, K = 1", network("small")},
      {"Pixels, network base, K = 1", network("base")}, {"Bins, two layers", layers()}};
  std::vector<Table> tables;
  for (const auto& [name, method] : methods) {
    if (std::string(name).find(only) == std::string::npos) continue;
    tables.push_back(measured(fmt::format("{}, {}x{} pixels", name, kWidth, kHeight), method, frames));
    tables.back().print();
  }
  writeJson(output + "/skip.json", tables);
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) {
  try {
    if (argc < 3 || argc > 4)
      fathom::fail("usage: bench_skip FOLDER_OF_FRAMES OUTPUT_FOLDER [PART_OF_A_METHOD'S_NAME]");
    fathom::bench::run(argv[1], argv[2], argc == 4 ? argv[3] : "");
  } catch (const std::exception& e) {
    fmt::print(stderr, "bench_skip: {}\n", e.what());
    return 1;
  }
}
