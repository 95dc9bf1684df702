// Error against time of every method and setting, on frames with references; where Open Image Denoise is found (see
// flat::loadOidn), with it and against it.
//
// Errors are of the small frames themselves, each planned as the program plans it. Seconds are of one of them, that with
// the median number of bins per pixel, mirrored to MEGAPIXELS, so that overheads count as little as on a film's frame;
// decoded, and without reading and writing. All methods are timed in turn.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "cli/calibration.h"
#include "cli/stopwatch.h"
#include "deep/compare.h"
#include "deep/io.h"
#include "flat/io.h"
#include "tests/bench/frames.h"
#include "tests/bench/pareto_frames.h"
#include "tests/bench/pareto_report.h"

namespace fathom::bench {
namespace {

const std::string& fileOf(const ParetoFrame& frame, const Method& method) {
  return method.setting.deep ? frame.deep : frame.flat;
}

FrameErrors errorsOn(const ParetoFrame& frame, const Method& method, const std::string& scratch) {
  const Prepared prepared = prepare(method, fileOf(frame, method), scratch);
  const deep::DeepImage result = denoised(prepared, prepared.image.copy());
  const flat::Image reference = flat::read(frame.reference);
  const auto error = [&](const deep::DeepImage& image) {
    return flat::compare(flattened(prepared, image), reference, {.correct = true}).relMse;
  };
  FrameErrors errors{frame.set, frame.name, error(prepared.image), error(result), {}, {}};
  if (!method.setting.deep || frame.deepReference.empty()) return errors;
  const deep::DeepImage bins = deep::read(frame.deepReference);
  const auto binError = [&](const deep::DeepImage& image) {
    return deep::compare(image, bins, {.correct = bins.find("variance.R") != nullptr}).bins.relMse;
  };
  errors.noisyBins = binError(prepared.image);
  errors.denoisedBins = binError(result);
  return errors;
}

// The frame as rendered that has the median number of bins per pixel.
const ParetoFrame& medianFrame(const std::vector<ParetoFrame>& frames) {
  std::vector<const ParetoFrame*> sorted;
  for (const ParetoFrame& frame : frames)
    if (frame.set == frames.front().set) sorted.push_back(&frame);
  std::ranges::sort(sorted, {}, &ParetoFrame::binsPerPixel);
  return *sorted[sorted.size() / 2];
}

// Seconds per megapixel of every method, and of the calibration.
void measureTimes(ParetoResult& result, const ParetoFrame& frame, double megapixels, int repeats,
                  const std::string& scratch) {
  const int width = int(std::lround(std::sqrt(megapixels * 1.6) * 1000)), height = int(std::lround(width / 1.6));
  const deep::DeepImage deep = tiled(prepare(result.methods.front().method, frame.deep, scratch).image, width, height);
  std::vector<std::vector<double>> seconds(result.methods.size());
  std::vector<double> calibrations;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    calibrations.push_back(cli::calibrationSeconds());
    for (size_t i = 0; i < result.methods.size(); ++i) {
      const Method& method = result.methods[i].method;
      const Prepared prepared = prepare(method, fileOf(frame, method), scratch);
      deep::DeepImage image = tiled(prepared.image, width, height);
      const cli::Stopwatch watch;
      denoised(prepared, std::move(image));
      seconds[i].push_back(watch.seconds());
    }
  }
  for (size_t i = 0; i < seconds.size(); ++i)
    result.methods[i].secondsPerMegapixel = median(seconds[i]) / (width * height * 1e-6);
  result.binsPerPixel = double(deep.samples()) / double(deep.pixels());
  result.calibration = median(calibrations);
  result.lights = deep.find("diffuse.R") && deep.find("specular.R") ? 2 : 1;
}

void write(const ParetoResult& result, const std::string& output) {
  std::string tables;
  std::vector<Table> all;
  for (const std::string& set : result.sets) {
    all.push_back(setTable(result, set));
    all.back().print();
    tables += markdownOf(all.back());
    for (const bool bins : {false, true}) {
      const Plot plot = setPlot(result, set, bins);
      if (plot.points.empty()) continue;
      const std::string which = set == result.sets.front() ? "" : fmt::format(".{}", set.substr(0, set.find(' ')));
      const std::string path = fmt::format("{}/pareto{}{}", output, which, bins ? ".bins" : "");
      writeSvg(path + ".svg", plot);
      writePng(path + ".png", plot);
    }
  }
  writeText(output + "/pareto.md", tables);
  writeText(output + "/pareto.csv", csvOf(frameTable(result)));
  writeJson(output + "/pareto.json", all);
  fmt::print("\nFor cli/time_budget.cpp:\n\n{}", costRows(result));
}

void run(const std::string& folder, const std::string& output, double megapixels, int repeats) {
  const std::string scratch = output + "/pareto_frames";
  std::filesystem::create_directories(scratch);
  const std::vector<ParetoFrame> frames = findParetoFrames(folder, scratch);
  ParetoResult result;
  for (const Method& method : paretoMethods()) result.methods.push_back({method, 0, {}});
  for (const ParetoFrame& frame : frames) {
    if (std::ranges::find(result.sets, frame.set) == result.sets.end()) result.sets.push_back(frame.set);
    for (MethodResult& of : result.methods) of.errors.push_back(errorsOn(frame, of.method, scratch));
  }
  measureTimes(result, medianFrame(frames), megapixels, repeats, scratch);
  write(result, output);
  std::filesystem::remove_all(scratch);
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) {
  try {
    if (argc < 3 || argc > 5)
      fathom::fail("usage: bench_pareto FOLDER_OF_FRAMES OUTPUT_FOLDER [MEGAPIXELS (1) [REPEATS (3)]]");
    const double megapixels = argc > 3 ? std::atof(argv[3]) : 1;
    const int repeats = argc > 4 ? std::atoi(argv[4]) : 3;
    if (!(megapixels >= 0.01 && megapixels <= 100)) fathom::fail("expected 0.01 to 100 megapixels, found {}", argv[3]);
    if (repeats < 1) fathom::fail("expected at least 1 repeat, found {}", argv[4]);
    fathom::bench::run(argv[1], argv[2], megapixels, repeats);
  } catch (const std::exception& e) {
    fmt::print(stderr, "bench_pareto: {}\n", e.what());
    return 1;
  }
}
