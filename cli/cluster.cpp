// `fathom cluster`.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <optional>

#include "base/error.h"
#include "cli/bands.h"
#include "cli/commands.h"
#include "deep/channels.h"
#include "deep/cluster.h"
#include "deep/ppu_scale.h"

namespace fathom::cli {

namespace {

struct ClusterCommand {
  std::string input, output;
  std::string part;  // number or name; empty: the first deep part
  deep::ClusterParams params;
  float ppuScale = 0;   // 0: from the file
  std::string prepass;  // empty: bins from the samples themselves
};

// Where the bins of a band lie.
class LayoutSource {
 public:
  LayoutSource(const ClusterCommand& command, const deep::PartInfo& part)
      : command_(command), ppuScale_(command.ppuScale) {
    if (!command.prepass.empty())
      prepass_.emplace(command.prepass, deep::ReadOptions{.part = {}, .channels = isGeometry});
    else if (ppuScale_ == 0)
      ppuScale_ = about(command.input, [&] { return deep::findPpuScale(part.attributes, part.displayWindow); });
  }

  deep::BinLayout of(const deep::DeepImage& band) {
    if (!prepass_) return about(command_.input, [&] { return deep::findBins(band, ppuScale_, command_.params); });
    const Box& rows = prepass_->part().dataWindow;
    const int y0 = std::clamp(band.dataWindow.y0, rows.y0, rows.y1), y1 = std::clamp(band.dataWindow.y1, y0, rows.y1);
    const deep::DeepImage prepass = prepass_->read(y0, y1);
    return about(command_.prepass, [&] { return deep::layoutFrom(prepass); });
  }

 private:
  static bool isGeometry(const std::string& name) { return name == "Z" || name == "ZBack" || name == "A"; }

  const ClusterCommand& command_;
  float ppuScale_;
  std::optional<deep::Reader> prepass_;
};

size_t countLost(const deep::DeepImage& samples, const deep::BinLayout& layout) {
  const Box& window = samples.dataWindow;
  size_t lost = 0;
  for (int y = window.y0; y < window.y1; ++y)
    for (int x = window.x0; x < window.x1; ++x)
      if (layout.at(x, y).size() == 0) lost += samples.count(window.index(x, y));
  return lost;
}

void runCluster(const ClusterCommand& command) {
  deep::Reader reader(command.input, {.part = command.part, .channels = {}});
  LayoutSource layouts(command, reader.part());
  const auto clustered = [&](const deep::DeepImage& band, const deep::BinLayout& layout) {
    return about(command.input, [&] { return deep::cluster(band, layout); });
  };
  const deep::DeepImage input = readLayout(reader);
  deep::DeepImage head = clustered(input, layouts.of(input));
  if (command.ppuScale > 0) head.attributes.set("fathom:ppuScale", command.ppuScale);
  const deep::PartInfo& part = reader.part();
  deep::Writer writer(command.output, head, part.dataWindow, likeInput(command.input, part));
  size_t samples = 0, bins = 0, lost = 0, nonFinite = 0;
  forEachBand(reader, [&](const deep::DeepImage& band) {
    const deep::BinLayout layout = layouts.of(band);
    const deep::DeepImage result = clustered(band, layout);
    samples += band.samples();
    bins += result.samples();
    lost += countLost(band, layout);
    nonFinite += deep::countNonFinite(band);
    writer.write(result);
  });
  writer.finish();
  fmt::print("{}: {} bins of {} samples, {:.2f} bins per pixel\n", command.output, bins, samples,
             double(bins) / double(std::max<size_t>(part.dataWindow.area(), 1)));
  if (lost > 0) fmt::print("{} samples lie in pixels without bins in {}: left out\n", lost, command.prepass);
  if (nonFinite > 0)
    fmt::print("{}: {} samples with values that are not finite: left out of the means\n", command.input, nonFinite);
}

}  // namespace

void addCluster(CLI::App& app) {
  auto command = std::make_shared<ClusterCommand>();
  CLI::App* sub = app.add_subcommand(
      "cluster",
      "Gather the samples of a deep render (one deep sample per camera sample, or any other deep EXR) into a few bins "
      "per "
      "pixel by depth, with the means, variances, half buffers and counts that `fathom denoise` works from.");
  sub->add_option("input", command->input, "The deep EXR with the samples")->required();
  sub->add_option("-o,--output", command->output, "The deep EXR with the bins to write")->required();
  sub->add_option("--part", command->part, "The part to take, by number or name; without it the first deep one");
  sub->add_option("--E", command->params.E,
                  "How fast bins get coarser behind the first one of a pixel; larger: fewer bins")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 16.0));
  sub->add_option("--first", command->params.first,
                  "Bin b = 1, 2, ... spans gaps of up to (b + first)^E pixel widths in depth; larger: fewer bins")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1e6));
  CLI::Option* scale =
      sub->add_option(
             "--ppu-scale", command->ppuScale,
             "The size in pixels of a one-unit quad one unit from the camera, where the file does not tell: image "
             "width / (2 tan(half the horizontal field of view))")
          ->check(CLI::PositiveNumber);
  sub->add_option(
         "--bins", command->prepass,
         "Take the bins from this deep EXR (a depth prepass: Z, and alphas if it has A) instead of from the samples")
      ->excludes(scale);
  sub->callback([command] { runCluster(*command); });
}

}  // namespace fathom::cli
