#include "cli/chain_stage.h"

#include <algorithm>
#include <utility>

namespace fathom::cli {

namespace {

// The memory that a band takes in all, in decoded sizes: what an operation takes and what it gives, with its plan.
constexpr double kCopies = 5;
// What the program takes without any image.
constexpr double kProgramBytes = 24e6;
// Bands are of whole tiles, and of as many rows of scanlines, where the memory allows that.
constexpr int kRowsAtLeast = 16;
// Larger bands only leave the caches.
constexpr double kMostBandBytes = 12e6;

std::string describe(const AnyImage& image) {
  return std::holds_alternative<deep::DeepImage>(image) ? "a deep image" : "a flat image";
}

bool isOf(ImageKind kind, const AnyImage& image) {
  return kind == ImageKind::Any || (kind == ImageKind::Deep) == std::holds_alternative<deep::DeepImage>(image);
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

double decodedBytes(const Chain& chain, std::span<const Stage> stages, std::span<const size_t> targets,
                    const Rows& band) {
  const auto wanted = rowsWanted(chain, stages, targets, band);
  double bytes = 0;
  for (size_t n = 0; n < stages.size(); ++n)
    if (wanted[n] && stages[n].source) bytes += stages[n].source->decodedBytes(wanted[n]->y0, wanted[n]->y1);
  return bytes;
}

}  // namespace

Rows within(const Rows& rows, const Box& window) {
  const int y0 = std::clamp(rows.y0, window.y0, window.y1);
  return {y0, std::clamp(rows.y1, y0, window.y1)};
}

Stage makeStage(const Chain& chain, std::span<const Stage> before, int frame, size_t memory) {
  const ChainNode& node = chain.nodes[before.size()];
  if (!node.operation) {
    auto source =
        std::make_unique<ChainSource>(node.file.at(frame), node.part, memory, channelsRead(chain, before.size()));
    Stage stage{std::move(source), {}, {}, {}, node.file.at(frame)};
    stage.form = stage.source->form();
    stage.window = stage.source->dataWindow();
    return stage;
  }
  const OperationSpec& spec = *node.operation;
  Stage stage{nullptr, {}, {}, {}, fmt::format("{}: {}", before[node.inputs[0]].about, spec.name)};
  if (const size_t colon = before[node.inputs[0]].about.find(": "); colon != std::string::npos)
    stage.about = fmt::format("{}: {}", before[node.inputs[0]].about.substr(0, colon), spec.name);
  std::vector<InputForm> forms;
  std::vector<Box> windows;
  for (size_t i = 0; i < node.inputs.size(); ++i) {
    const Stage& input = before[node.inputs[i]];
    const ImageKind kind = spec.inputs[std::min(i, spec.inputs.size() - 1)];
    if (!isOf(kind, input.form))
      fail("{}: expected {} as image {} of {}, found {}", input.about,
           kind == ImageKind::Deep ? "a deep image" : "a flat image", i + 1, node.inputs.size(), describe(input.form));
    forms.push_back({input.form, input.window});
    windows.push_back(input.window);
  }
  named(stage, [&] {
    std::map<std::string, std::string> given = node.arguments;
    if (given.contains("file")) given["file"] = parsePattern(given["file"]).at(frame);
    stage.operation = spec.make(Arguments(spec.name, spec.arguments, std::move(given)), forms);
    stage.window = stage.operation.window ? stage.operation.window(windows) : windows[0];
    if (Box& box = stage.window; box.empty()) box = {box.x0, box.y0, box.x0, box.y0};
  });
  return stage;
}

std::vector<std::optional<Rows>> rowsWanted(const Chain& chain, std::span<const Stage> stages,
                                            std::span<const size_t> targets, const Rows& band) {
  std::vector<std::optional<Rows>> wanted(stages.size());
  const auto want = [&](size_t node, const Rows& asked) {
    const Rows rows = within(asked, stages[node].window);
    std::optional<Rows>& all = wanted[node];
    if (!all || all->y0 == all->y1)
      all = rows;
    else if (rows.y0 < rows.y1)
      all = Rows{std::min(all->y0, rows.y0), std::max(all->y1, rows.y1)};
  };
  for (const size_t target : targets) want(target, band);
  for (size_t n = stages.size(); n-- > 0;) {
    if (!wanted[n]) continue;
    const Operation& operation = stages[n].operation;
    for (size_t i = 0; i < chain.nodes[n].inputs.size(); ++i)
      want(chain.nodes[n].inputs[i], operation.needs ? operation.needs(i, *wanted[n]) : *wanted[n]);
  }
  return wanted;
}

std::vector<Rows> planBands(const Chain& chain, std::span<const Stage> stages, std::span<const size_t> targets,
                            size_t memory, int bandRows) {
  Rows all{0, 0};
  int step = kRowsAtLeast, origin = 0;
  bool tiled = false;
  for (const size_t target : targets) {
    const Box& window = stages[target].window;
    if (window.empty()) continue;
    const bool first = all.y0 == all.y1;
    all = {first ? window.y0 : std::min(all.y0, window.y0), first ? window.y1 : std::max(all.y1, window.y1)};
  }
  for (const Stage& stage : stages)
    if (stage.source && stage.source->part()) {
      origin = stage.window.y0;
      tiled = stage.source->part()->tiled;
      step = tiled ? stage.source->part()->tileHeight : kRowsAtLeast;
    }
  const double limit = double(memory);
  const double budget =
      std::min(kMostBandBytes, std::max(limit - kProgramBytes, limit / 4) / (double(kBandsAtOnce) * kCopies));
  std::vector<Rows> bands;
  for (int y = all.y0; y < all.y1;) {
    int end = y;
    do {  // whole tiles, as long as they fit
      const int at = end - origin;
      end = std::min(all.y1, origin + (at >= 0 ? at / step + 1 : -((-at - 1) / step)) * step);
    } while (end < all.y1 && decodedBytes(chain, stages, targets, {y, end + step}) <= budget);
    while (!tiled && end - y > 1 && decodedBytes(chain, stages, targets, {y, end}) > budget) end = y + (end - y) / 2;
    if (bandRows > 0) end = std::min(all.y1, y + bandRows);
    bands.push_back({y, end});
    y = end;
  }
  return bands;
}

}  // namespace fathom::cli
