// The flat denoisers that commands offer by name, and the options that choose one.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "deep/denoise.h"
#include "flat/denoiser.h"

namespace CLI {
class App;
}

namespace fathom::flat {
struct OidnLibrary;
}

namespace fathom::cli {

constexpr const char* kOwnBase = "nlm";

struct BaseOptions {
  std::string name = kOwnBase;  // or "oidn"
  std::string oidnLibrary;      // file or folder; empty: see flat::loadOidn
};

// Adds --base and --oidn-library.
void addBaseOptions(CLI::App& command, BaseOptions& options);

struct BaseDenoiser {
  flat::Denoiser denoise;
  std::string settings;  // all that decides its result, as text to be hashed
};

// The denoiser of that name. `plan`: that of flat frames (deep::planFlat), whose quality chooses the method of oidn, too:
// Fast its fast network with the guides as they are, else its best one with guides denoised first. `scratch`: bytes that
// oidn may use beside the images. Throws Error where its library is not found.
BaseDenoiser makeBase(const BaseOptions& options, const deep::DenoisePlan& plan, size_t scratch);

// Open Image Denoise's library, or nothing where it is not found: see flat::loadOidn.
std::shared_ptr<const flat::OidnLibrary> findOidn(const std::string& path);

// All of a plan that decides what our own filter makes, as text to be hashed.
std::string describeFilter(const deep::DenoisePlan& plan);

}  // namespace fathom::cli
