// `fathom info`: what is in a file, and what the denoiser would make of it.
#include <OpenEXR/ImfAttribute.h>
#include <OpenEXR/ImfHeader.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "cli/bands.h"
#include "cli/commands.h"
#include "cli/statistics_report.h"
#include "deep/denoise.h"
#include "deep/io.h"
#include "deep/statistics.h"

namespace fathom::cli {

namespace {

using nlohmann::json;

struct InfoParams {
  std::vector<std::string> files;
  bool attributes = false;
  bool json = false;
};

struct Part {
  deep::PartInfo info;
  std::optional<deep::Statistics> statistics;  // of deep parts
  deep::DenoiseInputs inputs;
  std::vector<std::string> missing;
};

deep::Statistics gather(const std::string& file, int part) {
  deep::ReadOptions options;
  options.part = std::to_string(part);
  options.channels = [](const std::string& name) { return name == "Z" || name == "ZBack"; };
  deep::Reader reader(file, options);
  deep::Statistics statistics;
  forEachBand(reader, [&](const deep::DeepImage& band) { statistics.add(band); });
  return statistics;
}

std::vector<Part> inspect(const std::string& file) {
  std::vector<Part> parts;
  for (deep::PartInfo& info : deep::readParts(file)) {
    std::vector<std::string> names;
    for (const deep::ChannelInfo& channel : info.channels) names.push_back(channel.name);
    Part part;
    if (info.deep) part.statistics = gather(file, info.number);
    part.inputs = deep::findDenoiseInputs(names, info.attributes);
    part.missing = deep::describeMissing(part.inputs);
    part.info = std::move(info);
    parts.push_back(std::move(part));
  }
  return parts;
}

std::string kindOf(const deep::PartInfo& part) {
  const std::string kind = part.deep ? "deep " : "flat ";
  return kind + (part.tiled ? fmt::format("tiles {}x{}", part.tileWidth, part.tileHeight) : "scanlines");
}

std::string windowText(const Box& box) {
  return fmt::format("{} x {} at {} {}", box.width(), box.height(), box.x0, box.y0);
}

std::vector<std::string> usedInputs(const deep::DenoiseInputs& inputs) {
  std::vector<std::string> used;
  const auto add = [&](bool has, const char* what) {
    if (has) used.emplace_back(what);
  };
  add(inputs.components, "diffuse and specular");
  add(inputs.halves, "half buffers");
  add(inputs.albedo, "albedo");
  add(inputs.albedoHalves, "albedo halves");
  add(inputs.normal, "normals");
  add(inputs.variance, "colour variance");
  add(inputs.albedoVariance, "albedo variance");
  add(inputs.normalVariance, "normal variance");
  add(inputs.depthVariance, "depth variance");
  add(inputs.counts, "sample counts");
  add(inputs.volumes, "volumes");
  return used;
}

// The value where it is a number or text, else the type.
json attributeValue(const deep::Attributes& attributes, const std::string& name, const std::string& type) {
  if (const auto i = attributes.getInt(name)) return *i;
  if (const auto f = attributes.getFloat(name)) return *f;
  if (const auto s = attributes.getString(name)) return *s;
  if (const auto m = attributes.getMatrix(name)) return *m;
  return "(" + type + ")";
}

json attributesOf(const deep::PartInfo& part) {
  // What the other lines tell already.
  static const std::vector<std::string> kTold = {"channels", "chunkCount", "compression", "dataWindow", "displayWindow",
                                                 "name",     "tiles",      "type",        "version"};
  json result = json::object();
  const Imf::Header& header = part.attributes.header();
  for (auto a = header.begin(); a != header.end(); ++a)
    if (std::find(kTold.begin(), kTold.end(), a.name()) == kTold.end())
      result[a.name()] = attributeValue(part.attributes, a.name(), a.attribute().typeName());
  return result;
}

json boxJson(const Box& box) {
  return {{"x", box.x0}, {"y", box.y0}, {"width", box.width()}, {"height", box.height()}};
}

json partJson(const Part& part) {
  json channels = json::array();
  for (const auto& c : part.info.channels) channels.push_back({{"name", c.name}, {"type", typeName(c.type)}});
  json result = {{"part", part.info.number},
                 {"name", part.info.name},
                 {"deep", part.info.deep},
                 {"compression", part.info.compressionName},
                 {"dataWindow", boxJson(part.info.dataWindow)},
                 {"displayWindow", boxJson(part.info.displayWindow)},
                 {"channels", channels},
                 {"attributes", attributesOf(part.info)},
                 {"denoise", {{"uses", usedInputs(part.inputs)}, {"missing", part.missing}}}};
  if (part.info.tiled) result["tiles"] = {part.info.tileWidth, part.info.tileHeight};
  if (part.statistics) result["samples"] = statisticsJson(*part.statistics);
  return result;
}

void printLine(const char* label, const std::string& text) {
  fmt::print("{}\n", reportLine(label, text));
}

void printChannels(const deep::PartInfo& part) {
  for (deep::PixelType type : {deep::PixelType::Half, deep::PixelType::Float, deep::PixelType::Uint}) {
    std::vector<std::string> names;
    for (const auto& c : part.channels)
      if (c.type == type) names.push_back(printable(c.name));
    if (!names.empty()) printLine(typeName(type), fmt::format("{}", fmt::join(names, " ")));
  }
}

void print(const Part& part, bool withAttributes) {
  const deep::PartInfo& info = part.info;
  fmt::print("  part {}{}: {}, {}\n", info.number, info.name.empty() ? "" : " " + printable(info.name), kindOf(info),
             info.compressionName);
  printLine("data", windowText(info.dataWindow));
  if (info.displayWindow != info.dataWindow) printLine("display", windowText(info.displayWindow));
  printChannels(info);
  if (part.statistics)
    for (const std::string& line : statisticsLines(*part.statistics)) fmt::print("{}\n", line);
  const std::vector<std::string> used = usedInputs(part.inputs);
  printLine("denoise", "uses " + (used.empty() ? std::string("colour and depth alone")
                                               : fmt::format("{}", fmt::join(used, ", "))));
  for (const std::string& line : part.missing) printLine("", line);
  if (!withAttributes) return;
  const json attributes = attributesOf(info);
  for (const auto& [name, value] : attributes.items())
    printLine("attribute", printable(name) + " = " + value.dump(-1, ' ', false, json::error_handler_t::replace));
}

void run(const InfoParams& params) {
  json all = json::array();
  bool complete = true;
  for (const std::string& file : params.files) {
    try {
      const std::vector<Part> parts = inspect(file);
      if (!params.json) fmt::print("{}\n", file);
      json list = json::array();
      for (const Part& part : parts) params.json ? list.push_back(partJson(part)) : print(part, params.attributes);
      all.push_back({{"file", file}, {"parts", list}});
    } catch (const Error& e) {
      fmt::print(stderr, "fathom: {}\n", e.what());
      complete = false;
    }
  }
  if (params.json) fmt::print("{}\n", all.dump(2, ' ', false, json::error_handler_t::replace));
  if (!complete) throw Incomplete();
}

}  // namespace

void addInfo(CLI::App& app) {
  auto params = std::make_shared<InfoParams>();
  CLI::App* command = app.add_subcommand(
      "info", "Show what is in EXR files: parts, windows, channels, samples, depths, and what denoise would use");
  command->add_option("FILE", params->files, "EXR files, deep or flat")->required();
  command->add_flag("--attributes", params->attributes, "Print the attributes, too");
  command->add_flag("--json", params->json, "Print everything as JSON, a list with one entry per file");
  command->callback([params] { run(*params); });
}

}  // namespace fathom::cli
