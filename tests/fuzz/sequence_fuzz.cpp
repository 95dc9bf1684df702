// Any text as a file's name, and behind a NUL a range of frames: a pattern that its own text gives back, frames in order that
// their description gives back, or an Error.
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "cli/sequence.h"
#include "tests/fuzz/expect.h"

namespace fathom {
namespace {

bool same(const cli::FilePattern& a, const cli::FilePattern& b) {
  return a.before == b.before && a.after == b.after && a.width == b.width;
}

void names(const std::string& path) {
  const cli::FilePattern pattern = cli::parsePattern(path);
  fuzz::expect(same(cli::parsePattern(pattern.text()), pattern), "the same pattern from its own text");
  for (const int frame : {0, 7, 123456, -1}) {
    const std::string file = pattern.at(frame);
    fuzz::expect(pattern.numbered() || file == path, "a plain name as it is");
    fuzz::expect(file.size() >= pattern.before.size() + pattern.after.size() + size_t(pattern.width),
                 "at least as many digits as the pattern has");
  }
  if (path.find('/') != path.npos || path.find('\0') != path.npos) return;  // no folders but this one
  if (const auto numbered = cli::findNumber(path))
    fuzz::expect(numbered->pattern.at(numbered->frame) == path, "itself");
  cli::findSequence(path, pattern.numbered() ? "1-3" : "");
}

void frames(const std::string& range) {
  const std::vector<int> found = cli::parseFrames(range);
  fuzz::expect(!found.empty() && std::is_sorted(found.begin(), found.end()), "frames in order");
  fuzz::expect(std::adjacent_find(found.begin(), found.end()) == found.end(), "each frame once");
  std::string again = cli::describeFrames(found);
  std::erase(again, ' ');
  fuzz::expect(cli::parseFrames(again) == found, "the same frames from what describes them");
}

}  // namespace
}  // namespace fathom

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace fathom;
  const std::string input(reinterpret_cast<const char*>(data), size);
  const size_t end = std::min(input.find('\0'), size);
  fuzz::mayFail([&] { names(input.substr(0, end)); });
  fuzz::mayFail([&] { frames(input.substr(std::min(end + 1, size))); });
  return 0;
}
