#include "cli/chain_run.h"

#include <algorithm>
#include <chrono>
#include <numeric>
#include <optional>

#include "cli/chain_sink.h"
#include "cli/chain_source.h"
#include "flat/error.h"
#include "flat/parallel_in_order.h"

namespace fathom::cli {

namespace {

// How many bands are under way at once: one is read, one worked on, one written.
constexpr size_t kBandsAtOnce = 3;
// The memory that a band takes in all, in decoded sizes: what an operation takes and what it gives, with its plan.
constexpr double kCopies = 5;
// What the program takes without any image.
constexpr double kProgramBytes = 24e6;
// Bands are of whole tiles, and of as many rows of scanlines, where the memory allows that.
constexpr int kRowsAtLeast = 16;
// Larger bands only leave the caches.
constexpr double kMostBandBytes = 12e6;

class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// A node of the chain, made ready for one frame.
struct Stage {
  std::unique_ptr<ChainSource> source;  // of an image
  Operation operation;                  // of all others
  AnyImage form;
  Box window;
  std::string about;  // what errors begin with
};

// Something that takes a node's rows: an output file or an operation that watches.
struct Target {
  size_t node;
  std::function<void(AnyImage rows)> take;
};

Rows within(const Rows& rows, const Box& window) {
  const int y0 = std::clamp(rows.y0, window.y0, window.y1);
  return {y0, std::clamp(rows.y1, y0, window.y1)};
}

std::string describe(const AnyImage& image) {
  return std::holds_alternative<deep::DeepImage>(image) ? "a deep image" : "a flat image";
}

bool isOf(ImageKind kind, const AnyImage& image) {
  return kind == ImageKind::Any || (kind == ImageKind::Deep) == std::holds_alternative<deep::DeepImage>(image);
}

// Calls what an operation does; its errors get the names of file and operation.
template <class Body>
auto named(const std::string& about, const Body& body) {
  try {
    return body();
  } catch (const Error& e) {
    fail("{}: {}", about, e.what());
  }
}

// The channels of a node that anything reads; empty: all.
deep::ChannelFilter channelsRead(const Chain& chain, size_t node) {
  std::vector<std::function<bool(const std::string&)>> readers;
  for (const ChainOutput& output : chain.outputs)
    if (output.node == node) return {};
  for (const ChainNode& user : chain.nodes)
    for (size_t i = 0; i < user.inputs.size(); ++i) {
      if (user.inputs[i] != node) continue;
      if (!user.operation->reads) return {};
      readers.push_back([&reads = user.operation->reads, i](const std::string& channel) { return reads(i, channel); });
    }
  if (readers.empty()) return {};
  return [readers](const std::string& channel) {
    return std::ranges::any_of(readers, [&](const auto& reader) { return reader(channel); });
  };
}

class Run {
 public:
  Run(const Chain& chain, int frame, const ChainRunParams& params, const Progress& progress, ChainRunReport& report)
      : chain_(chain), params_(params) {
    for (const ChainNode& node : chain.nodes) {
      stages_.push_back(makeStage(node, frame));
      if (node.operation) scanAndForm(node, progress, report);
    }
  }

  const Stage& stage(size_t node) const { return stages_[node]; }

  // Calls take for each band of each target, bands from the top, by one thread at a time.
  void over(std::span<const Target> targets, const Progress& progress, ChainRunReport& report) {
    const std::vector<Rows> bands = bandsOf(targets);
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

  Stage makeStage(const ChainNode& node, int frame) {
    if (!node.operation) {
      auto source = std::make_unique<ChainSource>(node.file.at(frame), node.part, params_.memory,
                                                  channelsRead(chain_, size_t(&node - chain_.nodes.data())));
      Stage stage{std::move(source), {}, {}, {}, node.file.at(frame)};
      stage.form = stage.source->form();
      stage.window = stage.source->dataWindow();
      return stage;
    }
    const OperationSpec& spec = *node.operation;
    Stage stage{nullptr, {}, {}, {}, fmt::format("{}: {}", stages_[node.inputs[0]].about, spec.name)};
    if (const size_t colon = stages_[node.inputs[0]].about.find(": "); colon != std::string::npos)
      stage.about = fmt::format("{}: {}", stages_[node.inputs[0]].about.substr(0, colon), spec.name);
    std::vector<InputForm> forms;
    std::vector<Box> windows;
    for (size_t i = 0; i < node.inputs.size(); ++i) {
      const Stage& input = stages_[node.inputs[i]];
      const ImageKind kind = spec.inputs[std::min(i, spec.inputs.size() - 1)];
      if (!isOf(kind, input.form))
        fail("{}: expected {} as image {} of {}, found {}", input.about,
             kind == ImageKind::Deep ? "a deep image" : "a flat image", i + 1, node.inputs.size(),
             describe(input.form));
      forms.push_back({input.form, input.window});
      windows.push_back(input.window);
    }
    named(stage.about, [&] {
      std::map<std::string, std::string> given = node.arguments;
      if (given.contains("file")) given["file"] = parsePattern(given["file"]).at(frame);
      stage.operation = spec.make(Arguments(spec.name, spec.arguments, std::move(given)), forms);
      stage.window = stage.operation.window ? stage.operation.window(windows) : windows[0];
      if (Box& box = stage.window; box.empty()) box = {box.x0, box.y0, box.x0, box.y0};
    });
    return stage;
  }

  // Lets the last stage's operation look at all of its input, if it wants to, and finds what its result is like.
  void scanAndForm(const ChainNode& node, const Progress& progress, ChainRunReport& report) {
    Stage stage = std::move(stages_.back());
    stages_.pop_back();
    named(stage.about, [&] {
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

  // The rows of each node that the targets' rows are made of.
  std::vector<std::optional<Rows>> wantedBy(std::span<const Target> targets, const Rows& band) const {
    std::vector<std::optional<Rows>> wanted(stages_.size());
    const auto want = [&](size_t node, const Rows& asked) {
      const Rows rows = within(asked, stages_[node].window);
      std::optional<Rows>& all = wanted[node];
      if (!all || all->y0 == all->y1)
        all = rows;
      else if (rows.y0 < rows.y1)
        all = Rows{std::min(all->y0, rows.y0), std::max(all->y1, rows.y1)};
    };
    for (const Target& target : targets) want(target.node, band);
    for (size_t n = stages_.size(); n-- > 0;) {
      if (!wanted[n]) continue;
      const Operation& operation = stages_[n].operation;
      for (size_t i = 0; i < chain_.nodes[n].inputs.size(); ++i)
        want(chain_.nodes[n].inputs[i], operation.needs ? operation.needs(i, *wanted[n]) : *wanted[n]);
    }
    return wanted;
  }

  double decodedBytes(std::span<const Target> targets, const Rows& band) const {
    const auto wanted = wantedBy(targets, band);
    double bytes = 0;
    for (size_t n = 0; n < stages_.size(); ++n)
      if (wanted[n] && stages_[n].source) bytes += stages_[n].source->decodedBytes(wanted[n]->y0, wanted[n]->y1);
    return bytes;
  }

  // Where bands begin and end, over the rows of all targets.
  std::vector<Rows> bandsOf(std::span<const Target> targets) const {
    Rows all{0, 0};
    int step = kRowsAtLeast, origin = 0;
    bool tiled = false;
    for (const Target& target : targets) {
      const Box& window = stages_[target.node].window;
      if (window.empty()) continue;
      const bool first = all.y0 == all.y1;
      all = {first ? window.y0 : std::min(all.y0, window.y0), first ? window.y1 : std::max(all.y1, window.y1)};
    }
    for (const Stage& stage : stages_)
      if (stage.source && stage.source->part()) {
        origin = stage.window.y0;
        tiled = stage.source->part()->tiled;
        step = tiled ? stage.source->part()->tileHeight : kRowsAtLeast;
      }
    const double memory = double(params_.memory);
    const double budget =
        std::min(kMostBandBytes, std::max(memory - kProgramBytes, memory / 4) / (double(kBandsAtOnce) * kCopies));
    std::vector<Rows> bands;
    for (int y = all.y0; y < all.y1;) {
      int end = y;
      do {  // whole tiles, as long as they fit
        const int at = end - origin;
        end = std::min(all.y1, origin + (at >= 0 ? at / step + 1 : -((-at - 1) / step)) * step);
      } while (end < all.y1 && decodedBytes(targets, {y, end + step}) <= budget);
      while (!tiled && end - y > 1 && decodedBytes(targets, {y, end}) > budget) end = y + (end - y) / 2;
      if (params_.bandRows > 0) end = std::min(all.y1, y + params_.bandRows);
      bands.push_back({y, end});
      y = end;
    }
    return bands;
  }

  Band fetchBand(std::span<const Target> targets, const Rows& rows, uint64_t& samples) {
    Band band{rows, wantedBy(targets, rows), std::vector<std::optional<AnyImage>>(stages_.size())};
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
      AnyImage made = named(stage.about, [&] { return stage.operation.apply(std::move(inputs)); });
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
