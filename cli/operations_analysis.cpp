// Operations that tell what is in an image: ids, points, sample, stats.
#include <fmt/format.h>

#include <atomic>
#include <charconv>
#include <memory>
#include <utility>

#include "base/error.h"
#include "cli/operation.h"
#include "cli/sample_report.h"
#include "cli/statistics_report.h"
#include "deep/ops/ids.h"
#include "deep/ops/points.h"
#include "deep/ops/stats.h"
#include "flat/output_file.h"

namespace fathom::cli {

namespace {

// "3,7,0xdeadbeef"
std::vector<uint32_t> parseIds(const std::vector<std::string>& words) {
  std::vector<uint32_t> ids;
  for (const std::string& word : words) {
    const bool hexadecimal = word.starts_with("0x") || word.starts_with("0X");
    const char* end = word.data() + word.size();
    const auto [stop, error] =
        std::from_chars(word.data() + (hexadecimal ? 2 : 0), end, ids.emplace_back(), hexadecimal ? 16 : 10);
    if (error != std::errc() || stop != end) fail("values: expected ids like 3,7,0xdeadbeef, found {}", word);
  }
  return ids;
}

Operation makeMatte(const Arguments& arguments) {
  if (arguments.has("ranks")) fail("expected values or ranks, found both");
  const auto ids = parseIds(arguments.words("values"));
  const auto make = arguments.flag("each") ? deep::idMattes : deep::idMatte;
  return {.apply = [=, channel = arguments.text("channel")](std::vector<AnyImage> in) -> AnyImage {
    return make(deepOf(in[0]), channel, ids);
  }};
}

Operation makeIds(const Arguments& arguments, std::span<const InputForm>) {
  if (arguments.has("values")) return makeMatte(arguments);
  if (arguments.flag("each")) fail("each: expected values, too, found none");
  const int ranks = arguments.has("ranks") ? arguments.whole("ranks") : 6;
  const auto most = std::make_shared<std::atomic<size_t>>(0);
  Operation operation;
  operation.apply = [=, channel = arguments.text("channel")](std::vector<AnyImage> in) -> AnyImage {
    deep::RankedIds ranked = deep::rankIds(deepOf(in[0]), channel, ranks);
    size_t before = *most;
    while (ranked.most > before && !most->compare_exchange_weak(before, ranked.most)) continue;
    return std::move(ranked.image);
  };
  operation.summary = [=, kept = size_t(ranks) + size_t(ranks % 2)]() -> std::vector<std::string> {
    if (*most <= kept) return {};
    return {fmt::format("up to {} ids in a pixel: those of least coverage beyond {} ranks are left out", most->load(),
                        kept)};
  };
  return operation;
}

AnyImage first(std::vector<AnyImage> images) {
  return std::move(images[0]);
}

void append(OutputFile& file, const std::string& text) {
  file.append({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
}

struct PointsFile {
  OutputFile file;
  uint64_t points = 0;

  explicit PointsFile(const std::string& path) : file(path) {}
};

Operation makePoints(const Arguments& arguments, std::span<const InputForm> inputs) {
  const deep::DeepImage& form = deepOf(inputs[0].image);
  deep::PointsParams params;
  params.world = arguments.has("space") ? arguments.text("space") == "world" : deep::hasWorldSpace(form);
  if (arguments.has("fov")) params.fieldOfView = float(arguments.number("fov"));
  params.leastAlpha = float(arguments.number("alpha"));
  params.every = arguments.whole("every");
  (void)deep::plyPoints(form, params);  // throws what there is to throw before there is a file
  const auto out = std::make_shared<PointsFile>(arguments.text("file"));
  append(out->file, deep::plyHeader(0));
  Operation operation{first};
  operation.watch = [=](const AnyImage& band) {
    const std::vector<uint8_t> bytes = deep::plyPoints(deepOf(band), params);
    out->file.append(bytes);
    out->points += bytes.size() / deep::kPlyPointBytes;
  };
  operation.summary = [=]() -> std::vector<std::string> {
    const std::string header = deep::plyHeader(out->points);
    out->file.overwrite(0, {reinterpret_cast<const uint8_t*>(header.data()), header.size()});
    out->file.finish();
    return {fmt::format("{}: {} points in {} space", out->file.path(), out->points, params.world ? "world" : "camera")};
  };
  return operation;
}

// The lines of a report, or, with a file, those lines in it and none for the user.
std::vector<std::string> deliver(const Arguments& arguments, std::vector<std::string> lines) {
  if (!arguments.has("file")) return lines;
  OutputFile file(arguments.text("file"));
  for (const std::string& line : lines) append(file, line + "\n");
  file.finish();
  return {};
}

std::string jsonText(const nlohmann::json& json) {
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
}

Operation makeSample(const Arguments& arguments, std::span<const InputForm> inputs) {
  const int x = arguments.whole("x"), y = arguments.whole("y");
  const Box window = inputs[0].dataWindow;
  if (!window.contains(x, y))
    fail("expected a pixel of the data window, {} x {} at {} {}, found {} {}", window.width(), window.height(),
         window.x0, window.y0, x, y);
  const auto lines = std::make_shared<std::vector<std::string>>();
  Operation operation{first};
  operation.watch = [=, json = arguments.flag("json")](const AnyImage& image) {
    const deep::DeepImage& band = deepOf(image);
    if (!band.dataWindow.contains(x, y)) return;
    *lines = json ? std::vector{jsonText(sampleJson(band, x, y))} : sampleTable(band, x, y);
  };
  operation.summary = [=] { return deliver(arguments, *lines); };
  return operation;
}

Operation makeStats(const Arguments& arguments, std::span<const InputForm>) {
  const auto stats = std::make_shared<deep::ImageStats>();
  Operation operation{first};
  operation.watch = [=](const AnyImage& band) { stats->add(deepOf(band)); };
  operation.summary = [=] {
    return deliver(arguments, arguments.flag("json") ? std::vector{jsonText(statsJson(*stats))} : statsLines(*stats));
  };
  return operation;
}

}  // namespace

void addAnalysisOperations(std::vector<OperationSpec>& table) {
  using enum ImageKind;
  using Type = ArgumentType;
  table.push_back({"ids",
                   "A matte of the samples with given ids, exact for hidden, soft and volumetric ones; or, without "
                   "values, all ids ranked by coverage, as Cryptomatte has them.",
                   {Deep},
                   false,
                   {{"values", Type::Text, "", "the ids, like 3,7,0xdeadbeef: their matte becomes A"},
                    {"each", Type::Flag, "0", "a channel for each of the values: id.3, id.7"},
                    {"channel", Type::Text, "id", "the channel with the ids (UINT)"},
                    {"ranks", Type::Whole, "", "without values: how many ids a pixel can have; 6 if not given"}},
                   makeIds});
  table.push_back({"points",
                   "The samples as a cloud of points, a PLY file for 3D programs.",
                   {Deep},
                   false,
                   {{"file", Type::Text, "", "the PLY file to write", true},
                    {"alpha", Type::Number, "0.01", "samples with less alpha are left out"},
                    {"every", Type::Whole, "1", "take about one of so many samples"},
                    {"space",
                     Type::Text,
                     "",
                     "if not given: world where the image knows its camera's place, else camera",
                     false,
                     {"world", "camera"}},
                    {"fov", Type::Number, "", "horizontal field of view in degrees, where the image does not tell it"}},
                   makePoints,
                   true});
  table.push_back(
      {"sample",
       "All samples of one pixel: every channel, how much is seen of each sample, and how much light passes "
       "what is in front of it.",
       {Deep},
       false,
       {{"x", Type::Whole, "", "the pixel's column", true},
        {"y", Type::Whole, "", "the pixel's row, from the top", true},
        {"json", Type::Flag, "0", "as JSON"},
        {"file", Type::Text, "", "write it to this file instead of the screen"}},
       makeSample,
       true});
  table.push_back(
      {"stats",
       "What is in the image: samples per pixel, depths, alpha, tidiness, memory, and the range of every "
       "channel.",
       {Deep},
       false,
       {{"json", Type::Flag, "0", "as JSON"}, {"file", Type::Text, "", "write it to this file instead of the screen"}},
       makeStats,
       true});
}

}  // namespace fathom::cli
