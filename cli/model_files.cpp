#include "cli/model_files.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <set>

#include "base/error.h"
#include "cli/content_hash.h"
#include "nn/weights.h"

namespace fathom::cli {

namespace {

namespace fs = std::filesystem;

constexpr const char* kVariable = "FATHOM_MODELS";
constexpr const char* kMixModel = "mix";
constexpr const char* kSuffix = ".safetensors";

std::string textOf(const nn::WeightFile& file, const std::string& key) {
  const auto found = file.metadata.find(key);
  return found == file.metadata.end() ? std::string() : printable(found->second);
}

// The file of an installed model; empty where there is none.
std::string installed(const std::string& name) {
  for (const std::string& path : findModels())
    if (fs::path(path).stem() == name) return path;
  return {};
}

std::string hashOf(const std::string& path) {
  ContentHash hash;
  hash.addFile(path);
  return fmt::format("network {:016x}", hash.value());
}

std::string pathOf(const std::string& model) {
  if (model.find('/') != std::string::npos || model.ends_with(kSuffix)) return model;
  if (std::string path = installed(model); !path.empty()) return path;
  fail("--model {}: expected {}{} in {}, or the name of a file that ends so; found none", model, model, kSuffix,
       fmt::join(modelFolders(), " or "));
}

template <class Result, class Net>
Result load(const std::string& model, nn::Precision precision) {
  Result result;
  result.path = pathOf(model);
  const nn::WeightFile file = nn::readWeights(result.path);
  result.net = std::make_shared<Net>(file, precision);
  for (const auto& [name, tensor] : file.tensors) result.parameters += tensor.values.size();
  result.name = textOf(file, "name");
  result.steps = textOf(file, "steps");
  result.licence = textOf(file, "licence");
  result.settings = hashOf(result.path);
  return result;
}

}  // namespace

std::vector<std::string> modelFolders() {
  if (const char* folder = std::getenv(kVariable); folder && *folder) return {folder};
  std::error_code none;
  std::vector<std::string> folders;
  const fs::path program = fs::read_symlink("/proc/self/exe", none);
  if (!none) folders.push_back((program.parent_path().parent_path() / "share/fathom/models").string());
  folders.emplace_back(FATHOM_SOURCE_MODELS);
  return folders;
}

std::vector<std::string> findModels() {
  std::vector<std::string> result;
  std::set<std::string> names;
  for (const std::string& folder : modelFolders()) {
    std::error_code none;
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, none))
      if (entry.path().extension() == kSuffix) files.push_back(entry.path());
    std::ranges::sort(files);
    for (const fs::path& file : files)
      if (names.insert(file.stem().string()).second) result.push_back(file.string());
  }
  return result;
}

Model loadModel(const std::string& model, nn::Precision precision) {
  return load<Model, nn::CompositionalNet>(model, precision);
}

LayersModel loadLayersModel(const std::string& model, nn::Precision precision) {
  return load<LayersModel, nn::LayersNet>(model, precision);
}

bool isLayersModel(const std::string& path) {
  const nn::WeightFile file = nn::readWeights(path);
  return textOf(file, "format") == "fathom-layers";
}

bool hasLayersModel() {
  return !installed(kLayersModel).empty();
}

bool hasMix() {
  return !installed(kMixModel).empty();
}

MixModel loadMix() {
  MixModel result;
  result.path = installed(kMixModel);
  if (result.path.empty())
    fail("--mix learned: expected {}{} in {}; found none", kMixModel, kSuffix, fmt::join(modelFolders(), " or "));
  const nn::WeightFile file = nn::readWeights(result.path);
  result.net = std::make_shared<nn::MixNet>(file);
  for (const auto& [name, tensor] : file.tensors) result.parameters += tensor.values.size();
  result.steps = textOf(file, "steps");
  result.licence = textOf(file, "licence");
  result.settings = hashOf(result.path);
  return result;
}

bool isMix(const std::string& path) {
  return textOf(nn::readWeights(path), "format") == "fathom-mix";
}

std::string defaultModel(bool best) {
  for (const char* name : {best ? "base" : "small", best ? "small" : "base"})
    if (!installed(name).empty()) return name;
  return {};
}

}  // namespace fathom::cli
