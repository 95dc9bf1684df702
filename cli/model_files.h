// The networks that are installed: weight files by name, and what commands need of them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "nn/compositional.h"
#include "nn/layers.h"
#include "nn/mix.h"

namespace fathom::cli {

// The folders where models are looked for, in this order: FATHOM_MODELS alone where that is set; else the one that is
// installed with the program, and the source tree's.
std::vector<std::string> modelFolders();

// The weight files in them, by their names; of two with the same name the first.
std::vector<std::string> findModels();

struct ModelFile {
  std::string path;
  size_t parameters = 0;
  std::string name, steps, licence;  // as the file says, "" where it does not
  std::string settings;              // tells its content, to be hashed
};

// The denoiser of flat frames.
struct Model : ModelFile {
  std::shared_ptr<const nn::CompositionalNet> net;
};

// That of deep frames, by layers.
struct LayersModel : ModelFile {
  std::shared_ptr<const nn::LayersNet> net;
};

// The name of the layered network that comes with the program.
constexpr const char* kLayersModel = "layers";

// `model`: a name that findModels finds (small, base), or a file. Throws Error where it cannot be had.
Model loadModel(const std::string& model, nn::Precision precision = nn::Precision::float32);
LayersModel loadLayersModel(const std::string& model, nn::Precision precision = nn::Precision::float32);

// Whether the layered network is installed.
bool hasLayersModel();

// Whether a file of weights is of the layered network.
bool isLayersModel(const std::string& path);

// The mixing network.
struct MixModel {
  std::string path;
  std::shared_ptr<const nn::MixNet> net;
  size_t parameters = 0;
  std::string steps, licence;
  std::string settings;
};

bool hasMix();
// Throws Error where it is not installed or cannot be read.
MixModel loadMix();

// Whether a file says that it holds the mixing network. Throws Error where it cannot be read.
bool isMix(const std::string& path);

// The model that is meant where none is named: base for `best`, else small; where that is not installed, the other. Empty
// where neither is.
std::string defaultModel(bool best);

}  // namespace fathom::cli
