// The flat denoisers that commands offer by name, and the options that choose one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "deep/denoise.h"
#include "flat/denoiser.h"

namespace CLI {
class App;
}

namespace fathom::flat {
struct OidnLibrary;
}

namespace fathom::nn {
class MixNet;
}

namespace fathom::cli {

constexpr const char* kOwnBase = "nlm";
constexpr const char* kOidnBase = "oidn";
constexpr const char* kNeuralBase = "neural";
constexpr const char* kLayersBase = "layers";  // of deep frames alone: see cli/layers_frame
constexpr const char* kAutoBase = "auto";      // one of the others: see cli/method_choice

constexpr const char* kLearnedMix = "learned";
constexpr const char* kFormulaMix = "formula";
constexpr const char* kAutoMix = "auto";  // learned where the network is installed

struct BaseOptions {
  std::string name = kOwnBase;   // or several, with commas between them
  std::string oidnLibrary = {};  // file or folder; empty: see flat::loadOidn
  std::string model = {};        // name or file; empty: see defaultModel
  int components = 0;            // of the network: 1, 2, 4; 0: see flat::NeuralParams
  std::string mix = kAutoMix;    // of several, and of each with the render
};

// The names in an option's value.
std::vector<std::string> baseNames(const std::string& text);

// Adds --method (or --base, as it was called), --model, --components, --mix and --oidn-library.
void addBaseOptions(CLI::App& command, BaseOptions& options);

// Bytes that a denoiser takes beside an image of so many pixels, where it may use `scratch` to work in.
using BytesOf = std::function<size_t(size_t pixels, size_t scratch)>;

struct BaseDenoiser {
  flat::Denoiser denoise;
  std::string settings;          // all that decides its result, as text to be hashed
  BytesOf bytes = {};            // none: counted with the image
  bool readsStatistics = false;  // all variances, half buffers and counts
  bool gated = false;            // it reads those that our own filter does
  bool tellsErrors = false;      // error.{R,G,B} beside its colours
  std::function<void(std::map<std::string, uint64_t>&)> addCounts = {};  // of what it did since it was asked last
};

// What mixes, of the options; `net` is null for the formula. Throws Error where the network is wanted and not installed.
struct MixChoice {
  std::shared_ptr<const nn::MixNet> net;
  std::string settings;  // to be hashed
};
MixChoice mixOf(const BaseOptions& options);

// The denoiser of that name, which is not kAutoBase; of several names, their mix. `plan`: that of flat frames (deep::planFlat), whose quality chooses the
// method of oidn, too: Fast its fast network with the guides as they are, else its best one with guides denoised first; and
// the model of neural, where none is named; with its gate, if that is on. `scratch`: bytes that a library or network may use beside the images. Throws
// Error where its library or its model is not found.
BaseDenoiser makeBase(const BaseOptions& options, const deep::DenoisePlan& plan, size_t scratch);

// Open Image Denoise's library, or nothing where it is not found: see flat::loadOidn.
std::shared_ptr<const flat::OidnLibrary> findOidn(const std::string& path);

// Whether a model is named or installed. It may still be one that cannot be read.
bool hasModel(const BaseOptions& options);

// The arithmetic of the network that is meant, of flat frames or as a guide of deep ones, over that of a network as wide as
// `small`. Throws Error where it cannot be had.
double networkWork(BaseOptions options, bool guide);

// All of a plan that decides what our own filter makes, as text to be hashed.
std::string describeFilter(const deep::DenoisePlan& plan);

}  // namespace fathom::cli
