// What the deep denoiser costs and what it gives: seconds per megapixel of each stage, memory, skipping, and error
// against time.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "deep/denoise.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"
#include "flat/metrics.h"
#include "tests/bench/frames.h"
#include "tests/bench/measure.h"
#include "tests/bench/plot.h"

namespace fathom::bench {
namespace {

constexpr int kWidth = 1280, kHeight = 800;
constexpr double kMegapixels = kWidth * kHeight * 1e-6;
constexpr int kRepeats = 3;

struct Method {
  std::string name;
  deep::DenoiseParams params;
};
const std::vector<Method> kMethods = {{"fast", {.quality = deep::Quality::Fast}},
                                      {"balanced", {}},
                                      {"balanced, no gate", {.gate = false}},
                                      {"best", {.quality = deep::Quality::Best}}};

deep::DenoisePlan planFor(const deep::DeepImage& image, const deep::DenoiseParams& params) {
  std::vector<std::string> names;
  for (const deep::Channel& channel : image.channels) names.push_back(channel.name);
  return {findDenoiseInputs(names, image.attributes), params, meanLevel(image)};
}

size_t bytesOf(const deep::DeepImage& image) {
  return image.channels.size() * image.samples() * sizeof(float) + image.offsets.size() * sizeof(uint64_t);
}

// One column of a table of stages.
struct Case {
  std::string name;
  const deep::DeepImage* frame;
  deep::DenoiseParams params;
};

// The median seconds of each stage of each case; "total" is the sum of the stages.
std::vector<std::map<std::string, double>> stageMedians(const std::vector<Case>& cases) {
  std::vector<std::map<std::string, std::vector<double>>> seconds(cases.size());
  std::vector<std::function<void()>> runs;
  for (size_t i = 0; i < cases.size(); ++i)
    runs.push_back([&, i] {
      deep::DenoiseStats stats;
      deep::denoise(cases[i].frame->copy(), planFor(*cases[i].frame, cases[i].params), {}, &stats);
      double total = 0;
      for (const auto& [stage, value] : stats.seconds) {
        seconds[i][stage].push_back(value);
        if (stage.find("saved") == std::string::npos) total += value;
      }
      seconds[i]["total"].push_back(total);
    });
  interleavedMedians(runs, kRepeats);
  std::vector<std::map<std::string, double>> medians(cases.size());
  for (size_t i = 0; i < cases.size(); ++i)
    for (auto& [stage, values] : seconds[i]) {
      values.erase(values.begin());  // the warm-up
      medians[i][stage] = median(values);
    }
  return medians;
}

Table stageTable(const std::string& title, const std::vector<Case>& cases,
                 const std::vector<std::map<std::string, double>>& medians) {
  std::vector<std::string> columns = {"stage, s/MP"};
  for (const Case& of : cases) columns.push_back(of.name);
  Table table(title, columns);
  std::map<std::string, double> stages;
  for (const auto& of : medians) stages.insert(of.begin(), of.end());
  stages.erase("total");
  const auto add = [&](const std::string& stage) {
    std::vector<Cell> row = {stage};
    for (const auto& of : medians) {
      const auto found = of.find(stage);
      row.emplace_back(found == of.end() ? 0.0 : found->second / kMegapixels);
    }
    table.add(std::move(row));
  };
  for (const auto& [stage, seconds] : stages) add(stage);
  add("total");
  return table;
}

Table costTable(const deep::DeepImage& frame, std::map<std::string, double>& totals) {
  std::vector<Case> cases;
  for (const Method& method : kMethods) cases.push_back({method.name, &frame, method.params});
  const auto medians = stageMedians(cases);
  for (size_t i = 0; i < cases.size(); ++i) totals[cases[i].name] = medians[i].at("total") / kMegapixels;
  return stageTable(
      fmt::format("Denoiser, seconds per megapixel: {}x{}, {:.2f} bins per pixel, {} threads", kWidth, kHeight,
                  double(frame.samples()) / double(frame.pixels()), std::thread::hardware_concurrency()),
      cases, medians);
}

Table sparseTable(const deep::DeepImage& frame) {
  const Box kept = middleOf(frame.dataWindow, 0.1);
  const deep::DeepImage empty = keepNoisy(frame, kept, Rest::empty), clean = keepNoisy(frame, kept, Rest::converged);
  const std::vector<Case> cases = {
      {"full frame", &frame, {}}, {"nine tenths empty", &empty, {}}, {"nine tenths without noise", &clean, {}}};
  const auto medians = stageMedians(cases);
  Table table = stageTable("Skipping (balanced)", cases, medians);
  std::vector<Cell> shares = {"share of the full frame"};
  for (const auto& of : medians) shares.push_back(of.at("total") / medians[0].at("total"));
  table.add(shares);
  return table;
}

Table memoryTable(const deep::DeepImage& frame) {
  Table table("Denoiser, peak memory", {"method", "decoded input, MB", "peak, MB", "peak / input"});
  for (const Method& method : kMethods) {
    const auto input = double(bytesOf(frame));
    // The input is the denoiser's own copy, as it is in the program: it counts.
    const auto peak = double(peakGrowth([&] { deep::denoise(frame.copy(), planFor(frame, method.params)); }));
    table.add({method.name, input * 1e-6, peak * 1e-6, peak / input});
  }
  return table;
}

// The frames NAME.deep.exr of a folder that have a reference NAME.ref.exr, by NAME.
std::vector<std::string> framesWithReference(const std::string& folder) {
  std::vector<std::string> names;
  const std::string suffix = ".ref.exr";
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string path = entry.path().string();
    if (!path.ends_with(suffix)) continue;
    const std::string name = path.substr(0, path.size() - suffix.size());
    if (std::filesystem::exists(name + ".deep.exr")) names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

// relMSE of the flattened result, less the reference's own, per frame and method, and their mean against time.
Table errorTable(const std::vector<std::string>& frames, const std::map<std::string, double>& totals,
                 const std::string& picture) {
  std::vector<std::string> columns = {"frame, relMSE", "noisy"};
  for (const Method& method : kMethods) columns.push_back(method.name);
  Table table("Error, flattened", columns);
  std::vector<double> sums(kMethods.size() + 1);
  for (const std::string& name : frames) {
    const deep::DeepImage noisy = deep::read(name + ".deep.exr");
    const flat::Image reference = flat::read(name + ".ref.exr");
    const auto error = [&](const deep::DeepImage& image) {
      return flat::compare(deep::flatten(image), reference, {.correct = true}).relMse;
    };
    std::vector<double> errors = {error(noisy)};
    for (const Method& method : kMethods)
      errors.push_back(error(deep::denoise(noisy.copy(), planFor(noisy, method.params))));
    std::vector<Cell> row = {std::filesystem::path(name).filename().string()};
    for (size_t i = 0; i < errors.size(); ++i) {
      row.push_back(errors[i]);
      sums[i] += errors[i] / double(frames.size());
    }
    table.add(row);
  }
  std::vector<Cell> mean = {"mean"};
  std::vector<Cell> time = {"s/MP", 0.0};
  std::vector<Point> points;
  for (size_t i = 0; i < sums.size(); ++i) mean.push_back(sums[i]);
  for (size_t i = 0; i < kMethods.size(); ++i) {
    time.push_back(totals.at(kMethods[i].name));
    points.push_back({kMethods[i].name, totals.at(kMethods[i].name), sums[i + 1]});
  }
  table.add(mean);
  table.add(time);
  writeSvg(picture, {"", "seconds per megapixel", "relMSE, flattened", points});
  return table;
}

void run(const std::string& folder, const std::string& output) {
  const std::vector<std::string> frames = framesWithReference(folder);
  if (frames.empty()) fail("{}: expected NAME.deep.exr with NAME.ref.exr, found none", folder);
  const deep::DeepImage frame = tiled(deep::read(frames.front() + ".deep.exr"), kWidth, kHeight);
  std::vector<Table> tables;
  const auto add = [&](Table table) {
    table.print();
    tables.push_back(std::move(table));
  };
  std::map<std::string, double> totals;
  add(costTable(frame, totals));
  add(memoryTable(frame));
  add(sparseTable(frame));
  add(errorTable(frames, totals, output + "/error_time.svg"));
  writeJson(output + "/denoise.json", tables);
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) {
  try {
    if (argc != 3) fathom::fail("usage: bench_denoise FOLDER_OF_FRAMES OUTPUT_FOLDER");
    fathom::bench::run(argv[1], argv[2]);
  } catch (const std::exception& e) {
    fmt::print(stderr, "bench_denoise: {}\n", e.what());
    return 1;
  }
}
