// `fathom models`: the networks that are installed, and what they cost.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "base/error.h"
#include "cli/commands.h"
#include "cli/model_files.h"

namespace fathom::cli {

namespace {

constexpr const char* kFooter = R"(
GFLOP are for a megapixel and K = 1, 2 and 4 components; where a frame has diffuse and specular light apart, twice as many;
those of mix are for each denoiser that is mixed.

Models are looked for in the folder FATHOM_MODELS, or where that is not set in share/fathom/models beside the program's
folder, and in the source tree that it was built from.)";

std::string orUnknown(const std::string& text) {
  return text.empty() ? "-" : text;
}

void printMix() {
  const MixModel model = loadMix();
  fmt::print("{:<10} {:>5} {:>10} {:>18} {:>8} {:<12} {}\n", "mix", "-", model.parameters,
             fmt::format("{:.0f}", model.net->flopPerPixel() * 1e-3), orUnknown(model.steps), orUnknown(model.licence),
             model.path);
}

void printModel(const std::string& path) {
  if (isMix(path)) return printMix();
  const Model model = loadModel(path);
  const auto cost = [&](int components) { return fmt::format("{:.0f}", model.net->flopPerPixel(components) * 1e-3); };
  fmt::print("{:<10} {:>5} {:>10} {:>18} {:>8} {:<12} {}\n", orUnknown(model.name), model.net->width(),
             model.parameters, fmt::format("{} {} {}", cost(1), cost(2), cost(4)), orUnknown(model.steps),
             orUnknown(model.licence), model.path);
}

void runModels() {
  const std::vector<std::string> models = findModels();
  if (models.empty()) {
    fmt::print("no models in {}\n", fmt::join(modelFolders(), " or "));
    return;
  }
  fmt::print("{:<10} {:>5} {:>10} {:>18} {:>8} {:<12} {}\n", "name", "width", "parameters", "GFLOP", "steps", "licence",
             "file");
  bool complete = true;
  for (const std::string& path : models) {
    try {
      printModel(path);
    } catch (const Error& e) {
      fmt::print(stderr, "fathom: {}\n", e.what());
      complete = false;
    }
  }
  if (!complete) throw Incomplete();
}

}  // namespace

void addModels(CLI::App& app) {
  CLI::App* sub = app.add_subcommand("models", "List the networks that are installed, and what they cost");
  sub->footer(kFooter);
  sub->callback(runModels);
}

}  // namespace fathom::cli
