#include "flat/io.h"

#include <dlfcn.h>

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "flat/exr_size.h"
#include "flat/exr_writer.h"
#include "flat/oiio/module.h"
#include "flat/output_file.h"

namespace fathom::flat {

namespace {

constexpr const char* kModuleFile = "libfathom_oiio.so";

// Where the module may stand: beside the program, as it is built, or in ../lib/fathom, as it is installed.
std::filesystem::path modulePath() {
  const auto folder = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  const auto beside = folder / kModuleFile;
  return std::filesystem::exists(beside) ? beside : folder.parent_path() / "lib/fathom" / kModuleFile;
}

const OiioModule& load() {
  const std::string path = modulePath();
  void* library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!library) fail("{}: expected Fathom's module for flat images, found: {}", path, oneLine(dlerror()));
  const auto entry = reinterpret_cast<OiioModuleEntry>(dlsym(library, kOiioModuleEntry));
  const OiioModule* module = entry ? entry() : nullptr;
  if (!module || module->version != std::string_view(FATHOM_VERSION))
    fail("{}: expected the module of Fathom {}, found another", path, FATHOM_VERSION);
  return *module;
}

const OiioModule& oiio() {
  static const OiioModule& module = load();
  return module;
}

}  // namespace

Image read(const std::string& path, const ReadOptions& options) {
  const bool exr = isExr(path);
  if (exr) checkExrSize(path, options.memoryLimit);
  if (!exr && path.ends_with(".exr")) fail("{}: expected an OpenEXR file, found other bytes", path);
  return oiio().read(path, exr, options);
}

void write(const std::string& path, const Image& image, const WriteOptions& options) {
  ExrWriter writer(path, image, image.dataWindow, options);
  writer.write(image);
  writer.finish();
}

void writePng(const std::string& path, const Image& image) {
  if (image.dataWindow.empty()) fail("{}: expected an image to write, found an empty one", path);
  Image shown{{0, 0, image.dataWindow.width(), image.dataWindow.height()}, {}, {}, {}};
  shown.displayWindow = shown.dataWindow;
  const bool grey = !image.find("R");
  for (const char* name : {"R", "G", "B"}) {
    shown.planes.push_back({name, image.get(grey ? "Y" : name).values.copy()});
    for (float& v : shown.planes.back().values) v = v > 0 ? std::min(v, 1.0f) : 0;
    if (grey) break;
  }
  OutputFile file(path);
  const auto encoded = [&] {
    try {
      return oiio().encodePng(shown);
    } catch (const Error& e) {
      fail("{}: expected to be written, found: {}", path, e.what());
    }
  };
  file.append(encoded());
  file.finish();
}

}  // namespace fathom::flat
