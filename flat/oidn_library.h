// Open Image Denoise's library, found and loaded at run time: Fathom is built without it and runs without it.
//
// Source: the C API of version 2 as its manual describes it. Only what Fathom calls is declared.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

namespace fathom::flat {

struct OidnDevice;  // handles of the library
struct OidnFilter;

// The library's functions by their names without "oidn". Strings are the manual's parameter names; the numbers are those
// of its enumerations.
struct OidnLibrary {
  static constexpr int kCpu = 1;              // a type of device
  static constexpr int kFloat3 = 3;           // a format of images: three floats
  static constexpr int kCancelledByUser = 6;  // an error code; 0: none

  std::string file;     // where the loader found it
  std::string version;  // "2.5.1"

  OidnDevice* (*newDevice)(int type) = nullptr;
  void (*setDeviceInt)(OidnDevice*, const char* name, int value) = nullptr;
  void (*setDeviceBool)(OidnDevice*, const char* name, bool value) = nullptr;
  int (*getDeviceInt)(OidnDevice*, const char* name) = nullptr;
  // The first error of this thread since the last call; without a device, of the creation of one.
  int (*getDeviceError)(OidnDevice*, const char** message) = nullptr;
  void (*commitDevice)(OidnDevice*) = nullptr;
  void (*releaseDevice)(OidnDevice*) = nullptr;
  OidnFilter* (*newFilter)(OidnDevice*, const char* type) = nullptr;
  void (*setSharedFilterImage)(OidnFilter*, const char* name, void* pixels, int format, size_t width, size_t height,
                               size_t byteOffset, size_t pixelByteStride, size_t rowByteStride) = nullptr;
  void (*setFilterBool)(OidnFilter*, const char* name, bool value) = nullptr;
  void (*setFilterInt)(OidnFilter*, const char* name, int value) = nullptr;
  // The function returns whether to go on.
  void (*setFilterProgressMonitorFunction)(OidnFilter*, bool (*monitor)(void* user, double done), void* user) = nullptr;
  void (*commitFilter)(OidnFilter*) = nullptr;
  void (*executeFilter)(OidnFilter*) = nullptr;
  void (*releaseFilter)(OidnFilter*) = nullptr;
};

// The library at `path`, a file or a folder that has it (or whose "lib" has it); where that is empty, at the environment's
// FATHOM_OIDN_LIBRARY; where that is empty too, where the system's loader looks. It must be version 2.3 or newer. The
// library stays loaded until the program ends, since its worker threads do. Throws Error, which says what was looked for
// and how to get it.
std::shared_ptr<const OidnLibrary> loadOidn(const std::string& path = {});

}  // namespace fathom::flat
