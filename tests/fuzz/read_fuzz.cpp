// Any bytes as a deep EXR file: the reader gives an image or an Error, within its memory limit.
//
// The entry point is libFuzzer's; driver.cpp runs it where that is not at hand.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <string>

#include "deep/io.h"
#include "flat/error.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace fathom;
  const int fd = memfd_create("input", MFD_CLOEXEC);
  if (fd < 0 || write(fd, data, size) != ssize_t(size)) std::abort();
  const std::string path = "/proc/self/fd/" + std::to_string(fd);
  try {
    for (const deep::PartInfo& part : deep::readParts(path)) {
      deep::ReadOptions options;
      options.part = std::to_string(part.number);
      options.memoryLimit = size_t(64) << 20;
      deep::Reader reader(path, options);
      const int middle = part.dataWindow.y0 + part.dataWindow.height() / 2;
      const deep::DeepImage whole = reader.read();
      const deep::DeepImage band = reader.read(middle, middle + 1);
      if (band.samples() > whole.samples()) std::abort();
    }
  } catch (const Error& e) {
    if (std::string(e.what()).find('\n') != std::string::npos) std::abort();
  }
  close(fd);
  return 0;
}
