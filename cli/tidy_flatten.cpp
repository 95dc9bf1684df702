// `fathom tidy` and `fathom flatten`.
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>

#include "cli/bands.h"
#include "cli/commands.h"
#include "deep/channels.h"
#include "deep/flatten.h"
#include "deep/tidy.h"
#include "flat/io.h"

namespace fathom::cli {

namespace {

struct FileParams {
  std::string input, output;
  std::string part;  // number or name; empty: the first deep part
};

void addFiles(CLI::App& command, FileParams& params) {
  command.add_option("input", params.input, "The deep EXR to read")->required();
  command.add_option("-o,--output", params.output, "The EXR to write")->required();
  command.add_option("--part", params.part, "The part to take, by number or name; without it the first deep one");
}

bool isDepth(const std::string& name) {
  return name == "Z" || name == "ZBack";
}

// Over the whole file: whether channels have to be dropped must not depend on the band.
deep::Untidiness findUntidiness(const FileParams& params) {
  deep::Reader reader(params.input, {.part = params.part, .channels = isDepth});
  deep::Untidiness untidiness;
  forEachBand(reader, [&](const deep::DeepImage& band) {
    untidiness |= about(params.input, [&] { return deep::findUntidiness(band); });
  });
  return untidiness;
}

void runTidy(const FileParams& params) {
  const deep::Untidiness untidiness = findUntidiness(params);
  const bool merges = untidiness.pointsCoincide || untidiness.volumesOverlap;
  deep::Reader reader(params.input, {.part = params.part, .channels = {}});
  deep::DeepImage layout = readLayout(reader);
  const std::vector<std::string> dropped = merges ? deep::dropSampleStatistics(layout) : std::vector<std::string>();
  if (untidiness.any()) layout.attributes.erase("deepImageState");
  deep::Writer writer(params.output, layout, reader.part().dataWindow, likeInput(params.input, reader.part()));
  size_t before = 0, after = 0;
  forEachBand(reader, [&](deep::DeepImage band) {
    before += band.samples();
    if (merges) deep::dropSampleStatistics(band);
    const deep::DeepImage tidied = about(params.input, [&] { return deep::tidy(std::move(band)).image; });
    after += tidied.samples();
    writer.write(tidied);
  });
  writer.finish();
  fmt::print("{}: {} samples, {} before{}\n", params.output, after, before, untidiness.any() ? "" : ", was tidy");
  if (!dropped.empty())
    fmt::print("samples were merged or split, so these were dropped: {}\n", fmt::join(dropped, " "));
}

void runFlatten(const FileParams& params) {
  deep::Reader reader(params.input, {.part = params.part, .channels = {}});
  flat::Image result = about(params.input, [&] { return deep::flatten(readLayout(reader)); });
  result.dataWindow = reader.part().dataWindow;
  for (flat::Plane& plane : result.planes) plane.values = Buffer<float>(result.dataWindow.area());
  size_t nonFinite = 0;
  forEachBand(reader, [&](const deep::DeepImage& band) {
    nonFinite += deep::countNonFinite(band);
    const flat::Image rows = about(params.input, [&] { return deep::flatten(band); });
    const size_t first = result.dataWindow.index(band.dataWindow.x0, band.dataWindow.y0);
    for (size_t c = 0; c < rows.planes.size(); ++c)
      std::copy(rows.planes[c].values.begin(), rows.planes[c].values.end(), result.planes[c].values.begin() + first);
  });
  flat::write(params.output, result);
  if (nonFinite > 0)
    fmt::print("{}: {} samples with values that are not finite: taken for 0\n", params.input, nonFinite);
}

}  // namespace

void addTidyAndFlatten(CLI::App& app) {
  CLI::App* tidy = app.add_subcommand("tidy",
                                      "Sort the samples of a deep EXR front to back, split volumes that overlap "
                                      "others, and merge what then lies at the "
                                      "same depth. The picture stays the same; compositing gets exact and fast.");
  auto tidyParams = std::make_shared<FileParams>();
  addFiles(*tidy, *tidyParams);
  tidy->callback([tidyParams] { runTidy(*tidyParams); });

  CLI::App* flatten = app.add_subcommand(
      "flatten", "Composite the samples of a deep EXR into a flat EXR. Z becomes the mean depth of what is seen.");
  auto flattenParams = std::make_shared<FileParams>();
  addFiles(*flatten, *flattenParams);
  flatten->callback([flattenParams] { runFlatten(*flattenParams); });
}

}  // namespace fathom::cli
