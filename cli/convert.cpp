// `fathom convert`: a deep file with another compression, other pixel types, as scanlines or tiles, or with fewer
// channels.
#include <fmt/format.h>
#include <fnmatch.h>

#include <cmath>
#include <cstdio>
#include <map>

#include "base/error.h"
#include "cli/bands.h"
#include "cli/commands.h"
#include "deep/io.h"

namespace fathom::cli {

namespace {

using Patterns = std::vector<std::string>;

struct ConvertParams {
  std::string input, output;
  std::string part;  // empty: the first deep part, and the others are copied
  deep::Compression compression = deep::Compression::Zips;
  std::string tiles;                   // "64" or "64x32"; empty: scanlines
  Patterns channels, toHalf, toFloat;  // globs
};

bool matches(const Patterns& patterns, const std::string& name) {
  for (const std::string& pattern : patterns)
    if (fnmatch(pattern.c_str(), name.c_str(), 0) == 0) return true;
  return false;
}

// A pattern that no channel matches is a mistake, and so is a change of type of identifiers.
void checkPatterns(const std::string& file, const Patterns& patterns, const std::vector<deep::ChannelInfo>& channels,
                   bool values) {
  for (const std::string& pattern : patterns) {
    bool any = false;
    for (const deep::ChannelInfo& c : channels)
      any = any || ((!values || c.type != deep::PixelType::Uint) && matches({pattern}, c.name));
    if (!any) fail("{}: expected a {}channel like {}, found none", file, values ? "HALF or FLOAT " : "", pattern);
  }
}

void parseTiles(const std::string& text, deep::WriteOptions& options) {
  if (text.empty()) return;
  char rest = 0;
  const int n = std::sscanf(text.c_str(), "%7dx%7d%c", &options.tileWidth, &options.tileHeight, &rest);
  if (n == 1 && text.find_first_not_of("0123456789") == std::string::npos)
    options.tileHeight = options.tileWidth;
  else if (n != 2)
    options.tileWidth = 0;
  if (options.tileWidth <= 0 || options.tileHeight <= 0)
    fail("--tiles: expected a size such as 64 or 64x32, found {}", text);
}

class Types {
 public:
  explicit Types(const ConvertParams& params) : params_(params) {}

  void apply(deep::DeepImage& band) {
    for (deep::Channel& channel : band.channels) {
      if (channel.type == deep::PixelType::Uint) continue;
      if (matches(params_.toFloat, channel.name)) channel.type = deep::PixelType::Float;
      if (!matches(params_.toHalf, channel.name)) continue;
      if (channel.type == deep::PixelType::Float) countOverflows(channel);
      channel.type = deep::PixelType::Half;
    }
  }

  void report(const std::string& file) const {
    for (const auto& [name, count] : overflows_)
      fmt::print(stderr, "fathom: {}, channel {}: {} values are beyond the range of HALF and became infinite\n", file,
                 name, count);
  }

 private:
  void countOverflows(const deep::Channel& channel) {
    constexpr float kRoundsToInfinity = 65520;
    uint64_t count = 0;
    for (float v : channel.values) count += std::isfinite(v) && std::abs(v) >= kRoundsToInfinity;
    if (count > 0) overflows_[channel.name] += count;
  }

  const ConvertParams& params_;
  std::map<std::string, uint64_t> overflows_;
};

void run(const ConvertParams& params) {
  deep::ReadOptions readOptions;
  readOptions.part = params.part;
  if (!params.channels.empty())
    readOptions.channels = [&](const std::string& name) { return matches(params.channels, name); };
  deep::Reader reader(params.input, readOptions);
  const deep::PartInfo& part = reader.part();
  checkPatterns(params.input, params.channels, part.channels, false);
  checkPatterns(params.input, params.toHalf, part.channels, true);
  checkPatterns(params.input, params.toFloat, part.channels, true);

  deep::WriteOptions options;
  options.compression = params.compression;
  parseTiles(params.tiles, options);
  if (params.part.empty()) {
    options.otherPartsOf = params.input;
    options.replacedPart = part.number;
  }
  Types types(params);
  deep::DeepImage layout = readLayout(reader);
  types.apply(layout);
  deep::Writer writer(params.output, layout, part.dataWindow, options);
  forEachBand(reader, [&](deep::DeepImage band) {
    types.apply(band);
    writer.write(band);
  });
  writer.finish();
  types.report(params.output);
}

}  // namespace

void addConvert(CLI::App& app) {
  auto params = std::make_shared<ConvertParams>();
  CLI::App* command = app.add_subcommand(
      "convert", "Write a deep file again: other compression, pixel types, scanlines or tiles, fewer channels");
  command->add_option("IN", params->input, "A deep EXR file")->required();
  command->add_option("-o,--output", params->output, "The file to write; may be the same as IN")->required();
  const std::map<std::string, deep::Compression> compressions = {
      {"none", deep::Compression::None}, {"rle", deep::Compression::Rle}, {"zips", deep::Compression::Zips}};
  command->add_option("--compression", params->compression, "none, rle or zips (the default, which Nuke reads)")
      ->transform(CLI::CheckedTransformer(compressions).description(""))
      ->type_name("NAME");
  command->add_option("--tiles", params->tiles, "Write tiles of this size, such as 64 or 64x32; else scanlines")
      ->type_name("SIZE");
  command->add_option("--channels", params->channels, "Keep these channels only, such as 'R,G,B,A,Z*'")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NAMES");
  command->add_option("--half", params->toHalf, "Store these channels as HALF, such as 'R,G,B,diffuse.*'")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NAMES");
  command->add_option("--float", params->toFloat, "Store these channels as FLOAT")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NAMES");
  command->add_option(
      "--part", params->part,
      "Write this part alone, by number or name; else the first deep part is converted and all others are copied");
  command->callback([params] { run(*params); });
}

}  // namespace fathom::cli
