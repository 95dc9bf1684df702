// Any bytes as a deep EXR file: the reader gives an image or an Error, within its memory limit, and so does the writer
// when it copies the parts of such a file.
//
// The entry point is libFuzzer's; driver.cpp runs it where that is not at hand.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <string>

#include "base/error.h"
#include "deep/io.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace fathom;
  const int fd = memfd_create("input", MFD_CLOEXEC);
  if (fd < 0 || write(fd, data, size) != ssize_t(size)) std::abort();
  const std::string path = "/proc/self/fd/" + std::to_string(fd);
  try {
    const std::vector<deep::PartInfo> parts = deep::readParts(path);
    for (const deep::PartInfo& part : parts) {
      deep::ReadOptions options;
      options.part = std::to_string(part.number);
      options.memoryLimit = size_t(64) << 20;
      deep::Reader reader(path, options);
      const int middle = part.dataWindow.y0 + part.dataWindow.height() / 2;
      const deep::DeepImage whole = reader.read();
      const deep::DeepImage band = reader.read(middle, middle + 1);
      if (band.samples() > whole.samples()) std::abort();
      if (parts.size() == 1 || whole.channels.empty()) continue;
      deep::WriteOptions replace;
      replace.otherPartsOf = path;
      replace.replacedPart = part.number;
      deep::Writer("fuzz-output.exr", whole, whole.dataWindow, replace).write(whole);
    }
  } catch (const Error& e) {
    if (std::string(e.what()).find('\n') != std::string::npos) std::abort();
  }
  close(fd);
  return 0;
}
