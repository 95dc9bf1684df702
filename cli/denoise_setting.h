// How much work is done on every frame of a sequence: what a time budget chooses, and what outputs record of it.
#pragma once

#include <optional>
#include <string>

#include "deep/denoise.h"

namespace fathom::cli {

// In the place of a guide's file, whose name the command line has.
constexpr const char* kGuideFile = "FILE";

struct DenoiseSetting {
  deep::Quality quality = deep::Quality::Balanced;
  bool deep = true;           // for deep frames, else for flat ones
  std::string with = "none";  // deep: the guide (none, nlm, neural, oidn, FILE); flat: the base (nlm, neural, oidn)
  int components = 0;         // of the network: 1, 2 or 4; 0: what each tile is worth, or no network

  bool operator==(const DenoiseSetting&) const = default;
};

// The options that ask for it: "--quality balanced --flat-guide nlm", "--quality fast --method neural --components 1".
std::string describeSetting(const DenoiseSetting& setting);

// The setting that is described so; nothing for any other text.
std::optional<DenoiseSetting> parseSetting(const std::string& text);

// What an output says of the time budget that it was made with, as text.
struct BudgetRecord {
  std::string budget;   // "20 s"
  std::string setting;  // see describeSetting

  bool operator==(const BudgetRecord&) const = default;
};

// The names of the attributes.
constexpr const char* kBudget = "fathom:timeBudget";
constexpr const char* kSetting = "fathom:setting";

// The record of an output; nothing where there is no file, or none that a budget had a part in.
std::optional<BudgetRecord> readRecord(const std::string& path);

}  // namespace fathom::cli
