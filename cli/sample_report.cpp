#include "cli/sample_report.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "base/error.h"
#include "deep/ops/sample.h"

namespace fathom::cli {

namespace {

using nlohmann::json;

double alphaOf(const std::vector<deep::SampleLight>& light) {
  double alpha = 0;
  for (const deep::SampleLight& sample : light) alpha += sample.seen;
  return alpha;
}

std::string cell(const deep::Channel& channel, size_t sample) {
  return channel.type == deep::PixelType::Uint ? fmt::format("{}", channel.ids[sample])
                                               : fmt::format("{:g}", channel.values[sample]);
}

using Table = std::vector<std::vector<std::string>>;  // of columns

// Columns as wide as what stands in them, numbers to the right.
std::vector<std::string> aligned(const Table& columns) {
  std::vector<std::string> lines(columns[0].size());
  for (const std::vector<std::string>& column : columns) {
    const size_t width = std::ranges::max(column, {}, &std::string::size).size();
    for (size_t i = 0; i < lines.size(); ++i) lines[i] += fmt::format("  {:>{}}", column[i], width);
  }
  return lines;
}

Table transposed(const Table& table) {
  Table result(table[0].size());
  for (const std::vector<std::string>& column : table)
    for (size_t i = 0; i < result.size(); ++i) result[i].push_back(column[i]);
  return result;
}

// A column for each channel and for what is seen, the names on top; what the others follow from comes first.
Table columnsOf(const deep::DeepImage& image, size_t first, const std::vector<deep::SampleLight>& light) {
  Table depths, others;
  for (const char* name : {"Z", "ZBack", "A"})
    if (image.find(name)) depths.emplace_back(1, name);
  const auto add = [&](const deep::Channel& channel, std::vector<std::string>& column) {
    for (size_t i = 0; i < light.size(); ++i) column.push_back(cell(channel, first + i));
  };
  for (std::vector<std::string>& column : depths) add(*image.find(column[0]), column);
  for (const auto& [name, member] :
       {std::pair{"seen", &deep::SampleLight::seen}, {"front", &deep::SampleLight::front}}) {
    std::vector<std::string>& column = depths.emplace_back(1, name);
    for (const deep::SampleLight& sample : light) column.push_back(fmt::format("{:g}", sample.*member));
  }
  for (const deep::Channel& channel : image.channels)
    if (channel.name != "Z" && channel.name != "ZBack" && channel.name != "A")
      add(channel, others.emplace_back(1, printable(channel.name)));
  depths.insert(depths.end(), others.begin(), others.end());
  return depths;
}

}  // namespace

json valueJson(float value) {
  const std::string text = fmt::format("{}", std::isnan(value) ? std::abs(value) : value);
  if (!std::isfinite(value)) return text;
  double digits = 0;
  std::from_chars(text.data(), text.data() + text.size(), digits);  // which no locale changes
  return digits;
}

std::vector<std::string> sampleTable(const deep::DeepImage& image, int x, int y) {
  const std::vector<deep::SampleLight> light = deep::lightOf(image, x, y);
  const size_t first = size_t(image.offsets[image.dataWindow.index(x, y)]);
  std::vector<std::string> lines{
      fmt::format("pixel ({}, {}): {} samples, alpha {:g}", x, y, light.size(), alphaOf(light))};
  if (light.empty()) return lines;
  Table table = columnsOf(image, first, light);
  if (table.size() > light.size()) table = transposed(table);
  for (std::string& line : aligned(table)) lines.push_back(std::move(line));
  return lines;
}

json sampleJson(const deep::DeepImage& image, int x, int y) {
  const std::vector<deep::SampleLight> light = deep::lightOf(image, x, y);
  const size_t first = size_t(image.offsets[image.dataWindow.index(x, y)]);
  json samples = json::array();
  for (size_t i = 0; i < light.size(); ++i) {
    json channels = json::object();
    for (const deep::Channel& channel : image.channels)
      channels[channel.name] =
          channel.type == deep::PixelType::Uint ? json(channel.ids[first + i]) : valueJson(channel.values[first + i]);
    samples.push_back({{"channels", channels}, {"seen", light[i].seen}, {"front", light[i].front}});
  }
  return {{"x", x}, {"y", y}, {"alpha", alphaOf(light)}, {"samples", samples}};
}

}  // namespace fathom::cli
