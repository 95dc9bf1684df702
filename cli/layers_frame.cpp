#include "cli/layers_frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "cli/memory_limit.h"
#include "cli/model_files.h"
#include "cli/stopwatch.h"
#include "deep/channels.h"
#include "deep/layers_results.h"

namespace fathom::cli {

namespace {

// Reads a row for the names that our channel map gives to channels; from then on, only what is needed.
deep::LayerSource prepare(FrameSource& source, bool clustered, std::set<std::string>& notes,
                          deep::Attributes& attributes) {
  if (!source.deep()) fail("{}: expected a deep file for --method layers, found a flat one", source.path());
  if (clustered) source.clusterFirst();
  const Box& window = source.part().dataWindow;
  std::set<std::string> told;
  const deep::DeepImage row = source.read(window.y0, std::min(window.y0 + 1, window.y1), told);
  std::vector<std::string> names;
  for (const deep::Channel& channel : row.channels) names.push_back(channel.name);
  for (const char* needed : {"R", "G", "B", "A", "Z"})
    if (std::ranges::find(names, needed) == names.end())
      fail("{}, channel {}: expected in a file to denoise, found none", source.path(), needed);
  attributes = row.attributes;
  const deep::LayerInputs inputs = deep::findLayerInputs(names, row.attributes);
  for (const std::string& line : deep::describeMissing(inputs))
    notes.insert(fmt::format("{}: {}", source.path(), line));
  return {window, source.part().displayWindow, inputs, [&](int y0, int y1) { return source.read(y0, y1, notes); },
          [&](int y0, int y1) { return source.decodedBytes(y0, y1); }};
}

std::string nameOf(LayersOutput output) {
  switch (output) {
    case LayersOutput::LayerBins:
      return "layer bins";
    case LayersOutput::Layers:
      return "layers";
    case LayersOutput::Flat:
      return "flat";
    default:
      return "bins";
  }
}

}  // namespace

LayersPlan planLayers(const BaseOptions& base, const LayersOptions& options, deep::Quality quality, size_t memory) {
  const nn::Precision precision = quality == deep::Quality::Fast ? nn::Precision::automatic : nn::Precision::float32;
  const LayersModel model = loadLayersModel(base.model.empty() ? kLayersModel : base.model, precision);
  // Guided bins are images beside the network; else there are only the results.
  const bool alone = options.output != LayersOutput::Bins;
  const size_t room = alone ? workingBytes(memory) / 4 * 3 : decodedLimit(memory);
  return {model.net,
          {.layers = options.count, .memory = std::max<size_t>(room, 1)},
          options.output,
          fmt::format("{} quality {} layers {} as {}", model.settings, int(quality), options.count,
                      nameOf(options.output))};
}

bool layersFit(const LayersPlan& plan, const Box& dataWindow) {
  return plan.params.memory >= deep::leastLayersBytes(*plan.net, plan.params.layers, 2, dataWindow);
}

LayersFrame::LayersFrame(const LayersPlan& plan, const FrameInputs& inputs, const SourceOptions& options,
                         bool clustered)
    : plan_(plan), source_(inputs, options), layers_(prepare(source_, clustered, notes_, attributes_)) {
  const deep::LayerInputs has = layers_.inputs;
  const bool all = plan.output == LayersOutput::LayerBins;
  source_.want([has, all](const std::string& name) {
    return deep::layersRead(has, name) || (all && !deep::describesSamples(deep::roleOf(name, deep::PixelType::Float)));
  });
  scale_ = deep::measureLayers(layers_, plan_.params);
}

std::vector<Band> LayersFrame::bands() const {
  std::vector<Band> result;
  for (const auto& [y0, y1] : deep::layersBands(*plan_.net, plan_.params, scale_, layers_.dataWindow))
    result.push_back({y0, y1});
  return result;
}

deep::DeepImage LayersFrame::denoise(const Band& band, const Progress& progress, deep::DenoiseStats* stats) {
  const Stopwatch watch;
  deep::DeepImage result;
  deep::LayersCounts counts;
  // A frame of one band has its light measured on the way.
  if (!scale_.light && bands().size() > 1)
    scale_.light = deep::measureLight(*plan_.net, plan_.params, layers_, scale_, {{}, progress.stop});
  deep::denoiseLayers(
      *plan_.net, plan_.params, layers_, scale_, band.y0, band.y1,
      [&](const deep::LayeredRows& rows) {
        result = plan_.output == LayersOutput::LayerBins
                     ? deep::inLayerColours(layers_.read(rows.y0, rows.y1), rows, layers_.inputs)
                     : deep::layersImage(rows, attributes_);
      },
      progress, &counts);
  if (!stats) return result;
  stats->seconds["layers"] += watch.seconds();
  stats->counts["layer tiles"] += counts.filtered;
  stats->counts["layer tiles skipped"] += counts.skipped;
  stats->counts["non-finite samples"] += counts.nonFinite;
  return result;
}

flat::Image LayersFrame::flattened(const Progress& progress) {
  const Box& window = layers_.dataWindow;
  flat::Image result{window, layers_.displayWindow, {}, {}};
  for (const char* name : {"R", "G", "B", "A"}) result.add(name);
  deep::denoiseLayers(
      *plan_.net, plan_.params, layers_, scale_, window.y0, window.y1,
      [&](const deep::LayeredRows& rows) {
        const flat::Image part = deep::flattenedLayers(rows);
        for (size_t p = 0; p < part.planes.size(); ++p)
          std::ranges::copy(part.planes[p].values,
                            result.planes[p].values.data() + window.index(window.x0, part.dataWindow.y0));
      },
      progress);
  return result;
}

GuidePlan layersGuide(const LayersPlan& plan, const SourceOptions& options, bool cameraSamples) {
  GuidePlan guide{{{}, {}, deep::kNetworkGuide}, true, plan.settings};
  guide.flattened = [plan, options, cameraSamples](const FrameInputs& inputs, const Progress& progress) {
    return LayersFrame(plan, inputs, options, cameraSamples).flattened(progress);
  };
  guide.bytes = [plan](size_t pixels, size_t scratch) {
    const int side = int(std::sqrt(double(pixels))) + 1;
    return std::min(scratch, deep::mostLayersBytes(*plan.net, plan.params.layers, 2, {0, 0, side, side}));
  };
  return guide;
}

}  // namespace fathom::cli
