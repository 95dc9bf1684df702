#include "cli/chain_run.h"

#include <algorithm>
#include <optional>

#include "base/error.h"
#include "cli/chain_sink.h"
#include "cli/chain_stage.h"
#include "cli/stopwatch.h"
#include "flat/parallel_in_order.h"

namespace fathom::cli {

namespace {

// Something that takes a node's rows: an output file or an operation that watches.
struct Target {
  size_t node;
  std::function<void(AnyImage rows)> take;
};

std::vector<size_t> nodesOf(std::span<const Target> targets) {
  std::vector<size_t> nodes;
  for (const Target& target : targets) nodes.push_back(target.node);
  return nodes;
}

class Run {
 public:
  Run(const Chain& chain, int frame, const ChainRunParams& params, const Progress& progress, ChainRunReport& report)
      : chain_(chain), params_(params) {
    for (const ChainNode& node : chain.nodes) {
      stages_.push_back(makeStage(chain, stages_, frame, params.memory));
      if (node.operation) scanAndForm(node, progress, report);
    }
  }

  const Stage& stage(size_t node) const { return stages_[node]; }

  // Calls take for each band of each target, bands from the top, by one thread at a time.
  void over(std::span<const Target> targets, const Progress& progress, ChainRunReport& report) {
    const std::vector<Rows> bands = planBands(chain_, stages_, nodesOf(targets), params_.memory, params_.bandRows);
    if (bands.empty()) return;
    double read = 0, written = 0;
    uint64_t samples = 0;
    std::atomic<int64_t> worked = 0;  // microseconds
    std::atomic<size_t> taken = 0;
    const auto fetch = [&](size_t i) {
      const Stopwatch watch;
      progress.at(double(taken) / double(bands.size()));
      Band band = fetchBand(targets, bands[i], samples);
      read += watch.seconds();
      return band;
    };
    const auto make = [&](size_t, Band band) {
      const Stopwatch watch;
      std::vector<AnyImage> made = evaluate(targets, std::move(band));
      worked += int64_t(1e6 * watch.seconds());
      return made;
    };
    const auto take = [&](size_t, std::vector<AnyImage> made) {
      const Stopwatch watch;
      for (size_t t = 0; t < targets.size(); ++t) targets[t].take(std::move(made[t]));
      ++taken;
      written += watch.seconds();
    };
    parallelPipeline(0, bands.size(), kBandsAtOnce, fetch, make, take);
    report.counts["bands"] += bands.size();
    report.counts["samples read"] += samples;
    report.seconds["read"] += read;
    report.seconds["work"] += 1e-6 * double(worked);
    report.seconds["write"] += written;
  }

 private:
  // What is known of every node for a band: which rows are wanted, and the images read so far.
  struct Band {
    Rows rows;
    std::vector<std::optional<Rows>> wanted;  // of each node; none where nobody needs it
    std::vector<std::optional<AnyImage>> images;
  };

  // Lets the last stage's operation look at all of its input, if it wants to, and finds what its result is like.
  void scanAndForm(const ChainNode& node, const Progress& progress, ChainRunReport& report) {
    Stage stage = std::move(stages_.back());
    stages_.pop_back();
    named(stage, [&] {
      if (stage.operation.scan) {
        const Target scan{node.inputs[0], stage.operation.scan};
        ChainRunReport scanned;
        over({&scan, 1}, {{}, progress.stop}, scanned);
        report.seconds["scan"] += scanned.seconds["read"] + scanned.seconds["work"];
      }
      std::vector<AnyImage> empty;
      for (const size_t input : node.inputs) {
        const AnyImage& form = stages_[input].form;
        empty.push_back(rowsOf(form, dataWindowOf(form).y0, dataWindowOf(form).y0));
      }
      stage.form = stage.operation.apply(std::move(empty));
    });
    stages_.push_back(std::move(stage));
  }

  Band fetchBand(std::span<const Target> targets, const Rows& rows, uint64_t& samples) {
    Band band{rows, rowsWanted(chain_, stages_, nodesOf(targets), rows),
              std::vector<std::optional<AnyImage>>(stages_.size())};
    for (size_t n = 0; n < stages_.size(); ++n) {
      if (!stages_[n].source || !band.wanted[n]) continue;
      band.images[n] = stages_[n].source->read(band.wanted[n]->y0, band.wanted[n]->y1);
      if (const auto* deep = std::get_if<deep::DeepImage>(&*band.images[n])) samples += deep->samples();
    }
    return band;
  }

  // The images of the targets' rows, in their order.
  std::vector<AnyImage> evaluate(std::span<const Target> targets, Band band) const {
    std::vector<size_t> uses(stages_.size(), 0);
    for (const Target& target : targets) ++uses[target.node];
    for (size_t n = 0; n < stages_.size(); ++n)
      if (band.wanted[n])
        for (const size_t input : chain_.nodes[n].inputs) ++uses[input];
    const auto take = [&](size_t node, Rows asked) -> AnyImage {
      const Rows rows = within(asked, stages_[node].window);
      const Box box = dataWindowOf(*band.images[node]);
      const bool all = rows.y0 == box.y0 && rows.y1 == box.y1;
      if (--uses[node] == 0 && all) return std::move(*band.images[node]);
      AnyImage part =
          rowsOf(*band.images[node], std::clamp(rows.y0, box.y0, box.y1), std::clamp(rows.y1, box.y0, box.y1));
      if (uses[node] == 0) band.images[node].reset();
      return part;
    };
    for (size_t n = 0; n < stages_.size(); ++n) {
      const Stage& stage = stages_[n];
      if (stage.source || !band.wanted[n]) continue;
      std::vector<AnyImage> inputs;
      for (size_t i = 0; i < chain_.nodes[n].inputs.size(); ++i)
        inputs.push_back(take(chain_.nodes[n].inputs[i],
                              stage.operation.needs ? stage.operation.needs(i, *band.wanted[n]) : *band.wanted[n]));
      AnyImage made = named(stage, [&] { return stage.operation.apply(std::move(inputs)); });
      const Box wanted{stage.window.x0, band.wanted[n]->y0, stage.window.x1, band.wanted[n]->y1};
      band.images[n] = toWindow(std::move(made), wanted);
    }
    std::vector<AnyImage> result;
    for (const Target& target : targets) result.push_back(take(target.node, band.rows));
    return result;
  }

  const Chain& chain_;
  const ChainRunParams& params_;
  std::vector<Stage> stages_;
};

// What of the sources an output may carry on: how a deep file was stored, and its other parts, if there is but one.
deep::WriteOptions optionsFor(const Chain& chain, const Run& run) {
  deep::WriteOptions options;
  const ChainSource* only = nullptr;
  for (size_t n = 0; n < chain.nodes.size(); ++n) {
    const ChainSource* source = run.stage(n).source.get();
    if (!source || !source->part()) continue;
    if (only) return options;
    only = source;
  }
  if (!only) return options;
  options.compression = only->part()->compression;
  if (only->part()->tiled) options.tileWidth = only->part()->tileWidth, options.tileHeight = only->part()->tileHeight;
  options.otherPartsOf = only->path();
  options.replacedPart = only->part()->number;
  return options;
}

}  // namespace

std::vector<std::string> inputFiles(const Chain& chain, int frame) {
  std::vector<std::string> files;
  for (const ChainNode& node : chain.nodes)
    if (!node.operation) files.push_back(node.file.at(frame));
  return files;
}

std::vector<std::string> outputFiles(const Chain& chain, int frame) {
  std::vector<std::string> files;
  for (const ChainOutput& output : chain.outputs) files.push_back(output.file.at(frame));
  return files;
}

ChainRunReport runChain(const Chain& chain, int frame, const ChainRunParams& params, const Progress& progress) {
  ChainRunReport report;
  Run run(chain, frame, params, progress, report);
  std::vector<ChainSink> sinks;
  sinks.reserve(chain.outputs.size());
  std::vector<Target> targets;
  for (size_t n = 0; n < chain.nodes.size(); ++n)
    if (run.stage(n).operation.watch) targets.push_back({n, run.stage(n).operation.watch});
  for (const ChainOutput& output : chain.outputs) {
    const Stage& stage = run.stage(output.node);
    sinks.emplace_back(ChainSinkParams{output.file.at(frame), output.half, params.madeBy, optionsFor(chain, run)},
                       stage.form, stage.window);
    targets.push_back({output.node, [&sink = sinks.back(), &report](AnyImage rows) {
                         if (const auto* deep = std::get_if<deep::DeepImage>(&rows))
                           report.counts["samples written"] += deep->samples();
                         sink.write(std::move(rows));
                       }});
  }
  run.over(targets, progress, report);
  for (ChainSink& sink : sinks) sink.finish();
  for (size_t n = 0; n < chain.nodes.size(); ++n)
    if (run.stage(n).operation.summary)
      for (const std::string& line : run.stage(n).operation.summary())
        report.notes.push_back(chain.nodes[n].operation->watches  // a report, whose lines stand for themselves
                                   ? line
                                   : fmt::format("{}: {}", chain.nodes[n].operation->name, line));
  return report;
}

}  // namespace fathom::cli
