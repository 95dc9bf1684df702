// Stand-ins for Open Image Denoise's library, for what can go wrong with it. FAKE_VERSION is what its device says (then
// its filters fail); 1: there is no device; 0: a library without the functions.
#include <cstddef>

#if FAKE_VERSION != 0

namespace {

int handle;
const char* error = nullptr;

}  // namespace

extern "C" {

void* oidnNewDevice(int) {
  if (FAKE_VERSION > 1) return &handle;
  error = "this processor is too old.\n";
  return nullptr;
}
void oidnSetDeviceInt(void*, const char*, int) {}
void oidnSetDeviceBool(void*, const char*, bool) {}
int oidnGetDeviceInt(void*, const char*) {
  return FAKE_VERSION;
}
int oidnGetDeviceError(void*, const char** message) {
  *message = error;
  const int code = error ? 4 : 0;
  error = nullptr;
  return code;
}
void oidnCommitDevice(void*) {}
void oidnReleaseDevice(void*) {}
void* oidnNewFilter(void*, const char*) {
  return &handle;
}
void oidnSetSharedFilterImage(void*, const char*, void*, int, size_t, size_t, size_t, size_t, size_t) {}
void oidnSetFilterBool(void*, const char*, bool) {}
void oidnSetFilterInt(void*, const char*, int) {}
void oidnSetFilterProgressMonitorFunction(void*, bool (*)(void*, double), void*) {}
void oidnCommitFilter(void*) {}
void oidnExecuteFilter(void*) {
  error = "not enough\nmemory.";
}
void oidnReleaseFilter(void*) {}
}

#endif
