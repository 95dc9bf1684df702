#include "flat/oidn_library.h"

#include <dlfcn.h>

#include <array>
#include <cstdlib>
#include <filesystem>

#include "base/error.h"

namespace fathom::flat {

namespace {

constexpr const char* kVariable = "FATHOM_OIDN_LIBRARY";
constexpr std::array<const char*, 2> kNames = {"libOpenImageDenoise.so.2", "libOpenImageDenoise.so"};
// 2.3 is the first with all three qualities, and with the large networks for prefiltered guides.
constexpr int kOldest = 20300;
constexpr const char* kExpected = "expected Open Image Denoise 2.3 or newer";

// What the loader says, without the file that it begins with.
std::string loaderError(const std::string& file) {
  const char* message = dlerror();
  std::string text = oneLine(message ? message : "nothing");
  if (text.starts_with(file + ": ")) text.erase(0, file.size() + 2);
  return text;
}

// The library's file, where `path` is that or a folder; `source` is what named it.
std::string fileAt(const std::string& path, const std::string& source) {
  namespace fs = std::filesystem;
  std::error_code none;
  const fs::path absolute = fs::absolute(path);  // else the loader would search for a bare name
  if (!fs::exists(absolute, none)) fail("{}: {} there ({}), found nothing", path, kExpected, source);
  if (!fs::is_directory(absolute, none)) return absolute;
  for (const fs::path& folder : {absolute, absolute / "lib"})
    for (const char* name : kNames)
      if (fs::exists(folder / name, none)) return folder / name;
  fail("{}: expected {} or {} in this folder or in its lib ({}), found neither", path, kNames[0], kNames[1], source);
}

// RTLD_LOCAL: its symbols do not mix with ours. A oneTBB that the program has loaded serves the library as well.
void* open(const std::string& file) {
  return dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
}

void* openFile(const std::string& file) {
  void* handle = open(file);
  if (!handle) fail("{}: {}, found: {}", file, kExpected, loaderError(file));
  return handle;
}

void* openOfSystem() {
  if (void* handle = open(kNames[0])) return handle;
  const std::string found = loaderError(kNames[0]);
  if (void* handle = open(kNames[1])) return handle;
  fail(
      "Open Image Denoise: expected {} or {} where the system looks for libraries, found: {}; get it from "
      "openimagedenoise.org, a package of the system or `pip install pyoidn`, and name its file or folder with "
      "--oidn-library or {}",
      kNames[0], kNames[1], found, kVariable);
}

template <class Function>
void find(void* handle, const std::string& file, const char* name, Function& function) {
  function = reinterpret_cast<Function>(dlsym(handle, name));
  if (!function) fail("{}: {}, found a library without {}", file, kExpected, name);
}

void findAll(void* handle, OidnLibrary& library) {
  const auto get = [&](const char* name, auto& function) { find(handle, library.file, name, function); };
  get("oidnNewDevice", library.newDevice);
  get("oidnSetDeviceInt", library.setDeviceInt);
  get("oidnSetDeviceBool", library.setDeviceBool);
  get("oidnGetDeviceInt", library.getDeviceInt);
  get("oidnGetDeviceError", library.getDeviceError);
  get("oidnCommitDevice", library.commitDevice);
  get("oidnReleaseDevice", library.releaseDevice);
  get("oidnNewFilter", library.newFilter);
  get("oidnSetSharedFilterImage", library.setSharedFilterImage);
  get("oidnSetFilterBool", library.setFilterBool);
  get("oidnSetFilterInt", library.setFilterInt);
  get("oidnSetFilterProgressMonitorFunction", library.setFilterProgressMonitorFunction);
  get("oidnCommitFilter", library.commitFilter);
  get("oidnExecuteFilter", library.executeFilter);
  get("oidnReleaseFilter", library.releaseFilter);
}

// Only a device knows the version.
std::string findVersion(const OidnLibrary& library) {
  OidnDevice* device = library.newDevice(OidnLibrary::kCpu);
  if (!device) {
    const char* message = nullptr;
    library.getDeviceError(nullptr, &message);
    fail("{}: expected a library that runs on this processor, found: {}", library.file,
         oneLine(message ? message : "no device"));
  }
  const int version = library.getDeviceInt(device, "version");
  library.releaseDevice(device);
  std::string text = fmt::format("{}.{}.{}", version / 10000, version / 100 % 100, version % 100);
  if (version < kOldest) fail("{}: {}, found {}", library.file, kExpected, text);
  return text;
}

// The file that a function of the library is in.
std::string fileOf(void* handle) {
  Dl_info info{};
  void* function = dlsym(handle, "oidnNewDevice");
  return function && dladdr(function, &info) && info.dli_fname ? info.dli_fname : kNames[0];
}

}  // namespace

std::shared_ptr<const OidnLibrary> loadOidn(const std::string& path) {
  const char* variable = std::getenv(kVariable);
  const std::string named = !path.empty() ? path : variable ? variable : "";
  const auto library = std::make_shared<OidnLibrary>();
  void* handle = nullptr;
  if (named.empty()) {
    handle = openOfSystem();
    library->file = fileOf(handle);
  } else {
    library->file = fileAt(named, path.empty() ? kVariable : "--oidn-library");
    handle = openFile(library->file);
  }
  findAll(handle, *library);
  library->version = findVersion(*library);
  return library;
}

}  // namespace fathom::flat
