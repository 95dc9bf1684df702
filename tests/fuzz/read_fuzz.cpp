// Any bytes as an EXR file: the deep reader gives an image or an Error, within its memory limit, whole and in bands alike, and
// so does the writer when it copies the parts of such a file.
#include <sys/mman.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "deep/io.h"
#include "tests/fuzz/expect.h"

namespace fathom {
namespace {

void readPart(const std::string& path, const deep::PartInfo& part, bool copiesOthers) {
  deep::ReadOptions options;
  options.part = std::to_string(part.number);
  options.memoryLimit = size_t(64) << 20;
  deep::Reader reader(path, options);
  const int middle = part.dataWindow.y0 + part.dataWindow.height() / 2;
  const deep::DeepImage whole = reader.read();
  const deep::DeepImage band = reader.read(middle, middle + 1);
  fuzz::expect(band.samples() <= whole.samples(), "no more samples in a band than in the whole");
  if (!copiesOthers || whole.channels.empty()) return;
  deep::WriteOptions replace;
  replace.otherPartsOf = path;
  replace.replacedPart = part.number;
  deep::Writer("fuzz-output.exr", whole, whole.dataWindow, replace).write(whole);
}

}  // namespace
}  // namespace fathom

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace fathom;
  static const tbb::global_control oneThread(tbb::global_control::max_allowed_parallelism, 1);
  const int fd = memfd_create("input", MFD_CLOEXEC);
  fuzz::expect(fd >= 0 && write(fd, data, size) == ssize_t(size), "room in memory");
  const std::string path = "/proc/self/fd/" + std::to_string(fd);
  fuzz::mayFail([&] {
    const std::vector<deep::PartInfo> parts = deep::readParts(path);
    for (const deep::PartInfo& part : parts) fuzz::mayFail([&] { readPart(path, part, parts.size() > 1); });
  });
  close(fd);
  return 0;
}
