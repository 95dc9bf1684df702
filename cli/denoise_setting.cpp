#include "cli/denoise_setting.h"

#include <fmt/format.h>

#include <filesystem>

#include "base/error.h"
#include "cli/frame_sink.h"
#include "deep/io.h"

namespace fathom::cli {

namespace {

const char* nameOf(deep::Quality quality) {
  switch (quality) {
    case deep::Quality::Fast:
      return "fast";
    case deep::Quality::Best:
      return "best";
    default:
      return "balanced";
  }
}

}  // namespace

std::string describeSetting(const DenoiseSetting& setting) {
  return fmt::format("--quality {} {} {}{}", nameOf(setting.quality), setting.deep ? "--flat-guide" : "--method",
                     setting.with, setting.components ? fmt::format(" --components {}", setting.components) : "");
}

std::optional<DenoiseSetting> parseSetting(const std::string& text) {
  for (const deep::Quality quality : {deep::Quality::Fast, deep::Quality::Balanced, deep::Quality::Best})
    for (const bool isDeep : {true, false})
      for (const char* with : {"none", "nlm", "neural", "oidn", kGuideFile})
        for (const int components : {0, 1, 2, 4})
          if (const DenoiseSetting setting{quality, isDeep, with, components}; describeSetting(setting) == text)
            return setting;
  return {};
}

std::optional<BudgetRecord> readRecord(const std::string& path) {
  std::error_code none;
  if (!std::filesystem::exists(path, none)) return {};
  try {
    for (const deep::PartInfo& part : deep::readParts(path)) {
      const auto made = part.attributes.getString(kMadeBy), budget = part.attributes.getString(kBudget),
                 setting = part.attributes.getString(kSetting);
      if (made && budget && setting) return BudgetRecord{*budget, *setting};
    }
  } catch (const Error&) {
    // Not even an EXR file: that is for the run itself to say.
  }
  return {};
}

}  // namespace fathom::cli
