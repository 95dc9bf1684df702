#include "cli/statistics_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace fathom::cli {

namespace {

using nlohmann::json;

std::string channelLine(const deep::ChannelStats& c) {
  const bool ids = c.type == deep::PixelType::Uint;
  std::string line = fmt::format("    {:<20} {:<5}", printable(c.name), typeName(c.type));
  if (c.finite == 0)
    line += " no finite value";
  else if (ids)
    line += fmt::format(" {:>12.0f} {:>12.0f}", c.least, c.largest);
  else
    line += fmt::format(" {:>12g} {:>12g} {:>12g}", c.least, c.largest, c.mean());
  for (const auto& [count, name] : {std::pair{c.nans, "NaN"}, {c.infinities, "infinite"}, {c.negatives, "negative"}})
    if (count > 0) line += fmt::format("  {} {}", count, name);
  return line;
}

std::string alphaText(const deep::ImageStats& stats) {
  std::string text = fmt::format("{} samples of 0, {} of 1", stats.clear, stats.opaque);
  return text + (stats.badAlphas > 0 ? fmt::format(", {} outside of that or not a number", stats.badAlphas) : "");
}

std::string tidyText(const deep::ImageStats& stats) {
  if (stats.untidy == 0) return "yes";
  std::string text = fmt::format("no: {} pixels", stats.untidy);
  for (const auto& [count, name] : {std::pair{stats.unsorted, "not in order or with a range of no use"},
                                    {stats.pointsCoincide, "with points at the same depth"},
                                    {stats.volumesOverlap, "with volumes that others overlap"}})
    if (count > 0) text += fmt::format("; {} {}", count, name);
  return text;
}

}  // namespace

const char* typeName(deep::PixelType type) {
  return type == deep::PixelType::Uint ? "UINT" : type == deep::PixelType::Half ? "HALF" : "FLOAT";
}

std::string reportLine(const char* label, const std::string& text) {
  return fmt::format("    {:<10} {}", label, text);
}

std::vector<std::string> statisticsLines(const deep::Statistics& s) {
  const std::string most =
      s.mostSamples > 0 ? fmt::format("{} at most, at {} {}", s.mostSamples, s.mostX, s.mostY) : "0 at most";
  std::vector<std::string> lines{reportLine(
      "samples", fmt::format("{}: {:.3g} a pixel, {}", s.samples, double(s.samples) / double(s.pixels), most))};
  const uint64_t highest = std::ranges::max(s.histogram);
  for (size_t i = 0; i < s.histogram.size(); ++i) {
    if (s.histogram[i] == 0) continue;
    constexpr double kBar = 40;
    const auto bar = size_t(std::ceil(kBar * double(s.histogram[i]) / double(highest)));
    lines.push_back(fmt::format("    {:>10} {:5.1f} %  {}", s.bucketName(i),
                                100 * double(s.histogram[i]) / double(s.pixels), std::string(bar, '#')));
  }
  const auto add = [&](const char* label, const std::string& text) { lines.push_back(reportLine(label, text)); };
  if (s.nearest <= s.farthest) add("depth", fmt::format("{:g} to {:g}", s.nearest, s.farthest));
  if (s.volumes > 0) add("volumes", fmt::format("{} samples have an extent (ZBack behind Z)", s.volumes));
  if (s.unsortedPixels > 0)
    add("unsorted", fmt::format("{} pixels are not front to back: see fathom tidy", s.unsortedPixels));
  if (s.badDepths > 0) add("damaged", fmt::format("{} samples have a depth that is not finite", s.badDepths));
  return lines;
}

json statisticsJson(const deep::Statistics& s) {
  json histogram = json::array();
  for (size_t i = 0; i < s.histogram.size(); ++i)
    if (s.histogram[i] > 0) histogram.push_back({{"samples", s.bucketName(i)}, {"pixels", s.histogram[i]}});
  json result = {{"total", s.samples},
                 {"mean", double(s.samples) / double(s.pixels)},
                 {"most", s.mostSamples},
                 {"histogram", histogram},
                 {"volumes", s.volumes},
                 {"badDepths", s.badDepths},
                 {"unsortedPixels", s.unsortedPixels}};
  if (s.mostSamples > 0) result["mostAt"] = {s.mostX, s.mostY};
  if (s.nearest <= s.farthest) result["depth"] = {s.nearest, s.farthest};
  return result;
}

std::vector<std::string> statsLines(const deep::ImageStats& stats) {
  std::vector<std::string> lines = statisticsLines(stats.samples);
  lines.push_back(reportLine("alpha", alphaText(stats)));
  lines.push_back(reportLine("tidy", tidyText(stats)));
  lines.push_back(reportLine("memory", fmt::format("{:.1f} MB decoded", double(stats.bytes) / 1e6)));
  lines.push_back(fmt::format("    {:<20} {:<5} {:>12} {:>12} {:>12}", "channel", "type", "least", "largest", "mean"));
  for (const deep::ChannelStats& channel : stats.channels) lines.push_back(channelLine(channel));
  return lines;
}

json statsJson(const deep::ImageStats& stats) {
  json channels = json::array();
  for (const deep::ChannelStats& c : stats.channels) {
    json entry = {{"name", c.name}, {"type", typeName(c.type)}, {"finite", c.finite},
                  {"nan", c.nans},  {"infinite", c.infinities}, {"negative", c.negatives}};
    if (c.finite > 0) entry["least"] = c.least, entry["largest"] = c.largest;
    if (c.finite > 0 && c.type != deep::PixelType::Uint) entry["mean"] = c.mean();
    channels.push_back(std::move(entry));
  }
  return {{"pixels", stats.samples.pixels},
          {"samples", statisticsJson(stats.samples)},
          {"alpha", {{"clear", stats.clear}, {"opaque", stats.opaque}, {"bad", stats.badAlphas}}},
          {"untidyPixels",
           {{"any", stats.untidy},
            {"unsorted", stats.unsorted},
            {"pointsCoincide", stats.pointsCoincide},
            {"volumesOverlap", stats.volumesOverlap}}},
          {"bytes", stats.bytes},
          {"channels", channels}};
}

}  // namespace fathom::cli
