// `fathom models`: the networks that are installed, and what they cost.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <functional>

#include "base/error.h"
#include "cli/commands.h"
#include "cli/model_files.h"

namespace fathom::cli {

namespace {

constexpr const char* kFooter = R"(
GFLOP are for a megapixel and K = 1, 2 and 4 components; where a frame has diffuse and specular light apart, twice as many;
those of mix are for each denoiser that is mixed, those of the layered network for 8 samples a pixel and 1, 2 and 4 layers.

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

void printLine(const ModelFile& model, int width, const std::function<double(int)>& flopPerPixel) {
  const auto cost = [&](int parts) { return fmt::format("{:.0f}", flopPerPixel(parts) * 1e-3); };
  fmt::print("{:<10} {:>5} {:>10} {:>18} {:>8} {:<12} {}\n", orUnknown(model.name), width, model.parameters,
             fmt::format("{} {} {}", cost(1), cost(2), cost(4)), orUnknown(model.steps), orUnknown(model.licence),
             model.path);
}

void printModel(const std::string& path) {
  if (isMix(path)) return printMix();
  constexpr double kSamples = 8;
  if (isLayersModel(path)) {
    const LayersModel model = loadLayersModel(path);
    return printLine(model, model.net->width(), [&](int layers) { return model.net->flopPerPixel(kSamples, layers); });
  }
  const Model model = loadModel(path);
  printLine(model, model.net->width(), [&](int components) { return model.net->flopPerPixel(components); });
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
