// Stand-ins for Open Image Denoise's library, for what can go wrong with it, and one that answers with what it was asked.
// FAKE_VERSION is what its device says; 1: there is no device; 0: a library without the functions. Filters of 2.4.0 answer,
// those of others fail.
#include <cstddef>
#include <cstring>
#include <utility>

#if FAKE_VERSION != 0

namespace {

int device;
const char* error = nullptr;
int runs = 0;  // of guides since the last run of colours

struct Filter {
  float *color = nullptr, *albedo = nullptr, *normal = nullptr, *output = nullptr;
  size_t pixels = 0;
  bool hdr = false, cleanAux = false;
  int quality = 0, megabytes = -1;  // -1: not asked for
};

// A guide comes back 1 higher, or 10 where it was not filtered as one. Of colours, pixels tell in turn: their colour, albedo,
// normal, switches, and numbers.
void answer(const Filter& filter) {
  if (!filter.color) {
    for (size_t i = 0; i < 3 * filter.pixels; ++i) filter.output[i] += filter.hdr || filter.cleanAux ? 10.0f : 1.0f;
    ++runs;
    return;
  }
  for (size_t p = 0; p < filter.pixels; ++p) {
    float* to = filter.output + 3 * p;
    const float none[] = {-100, -100, -100}, switches[] = {filter.hdr ? 1.0f : 0.0f, filter.cleanAux ? 1.0f : 0.0f, 0},
                numbers[] = {float(filter.quality), float(filter.megabytes), float(runs)};
    const float* const told[] = {to, filter.albedo ? filter.albedo + 3 * p : none,
                                 filter.normal ? filter.normal + 3 * p : none, switches, numbers};
    std::memmove(to, told[p % 5], 3 * sizeof(float));
  }
  runs = 0;
}

}  // namespace

extern "C" {

void* oidnNewDevice(int) {
  if (FAKE_VERSION > 1) return &device;
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
  return new Filter;
}
void oidnSetSharedFilterImage(void* to, const char* name, void* pixels, int, size_t width, size_t height, size_t,
                              size_t, size_t) {
  auto& filter = *static_cast<Filter*>(to);
  filter.pixels = width * height;
  for (const auto& [called, image] : {std::pair{"color", &filter.color},
                                      {"albedo", &filter.albedo},
                                      {"normal", &filter.normal},
                                      {"output", &filter.output}})
    if (std::strcmp(name, called) == 0) *image = static_cast<float*>(pixels);
}
void oidnSetFilterBool(void* to, const char* name, bool value) {
  auto& filter = *static_cast<Filter*>(to);
  if (std::strcmp(name, "hdr") == 0) filter.hdr = value;
  if (std::strcmp(name, "cleanAux") == 0) filter.cleanAux = value;
}
void oidnSetFilterInt(void* to, const char* name, int value) {
  auto& filter = *static_cast<Filter*>(to);
  if (std::strcmp(name, "quality") == 0) filter.quality = value;
  if (std::strcmp(name, "maxMemoryMB") == 0) filter.megabytes = value;
}
void oidnSetFilterProgressMonitorFunction(void*, bool (*)(void*, double), void*) {}
void oidnCommitFilter(void*) {}
void oidnExecuteFilter(void* filter) {
  if (FAKE_VERSION == 20400)
    answer(*static_cast<Filter*>(filter));
  else
    error = "not enough\nmemory.";
}
void oidnReleaseFilter(void* filter) {
  delete static_cast<Filter*>(filter);
}
}

#endif
