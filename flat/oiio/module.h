// What libfathom_oiio.so offers: flat images read, and PNG written, through OpenImageIO. It stands beside the program, or in ../lib/fathom, and
// is loaded with the first such image: OpenImageIO brings some 260 libraries, which deep work does not need and which
// take a fifth of a second to start.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "flat/image.h"
#include "flat/io.h"

namespace fathom::flat {

// Errors are fathom::Error; read() names the file, the encoder says only what was found.
struct OiioModule {
  const char* version;  // the program's own, so that a module of another build is not taken
  // `exr`: the file begins as an EXR does, and its size was checked.
  Image (*read)(const std::string& path, bool exr, const ReadOptions& options);
  std::vector<uint8_t> (*encodePng)(const Image& image);
};

inline constexpr const char* kOiioModuleEntry = "fathomOiioModule";
using OiioModuleEntry = const OiioModule* (*)();

}  // namespace fathom::flat
