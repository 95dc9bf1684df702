#include "deep/exr_header.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <string>
#include <string_view>

#include "base/error.h"

namespace fathom::deep {

namespace {

// Of attribute types that always have the same, in bytes.
const std::map<std::string_view, int> kSizes = {{"box2f", 16},
                                                {"box2i", 16},
                                                {"chromaticities", 32},
                                                {"compression", 1},
                                                {"deepImageState", 1},
                                                {"double", 8},
                                                {"envmap", 1},
                                                {"float", 4},
                                                {"int", 4},
                                                {"keycode", 28},
                                                {"lineOrder", 1},
                                                {"m33d", 72},
                                                {"m33f", 36},
                                                {"m44d", 128},
                                                {"m44f", 64},
                                                {"rational", 8},
                                                {"tiledesc", 9},
                                                {"timecode", 8},
                                                {"v2d", 16},
                                                {"v2f", 8},
                                                {"v2i", 8},
                                                {"v3d", 24},
                                                {"v3f", 12},
                                                {"v3i", 12}};

std::string readName(HeaderStream& stream, const std::string& file) {
  constexpr size_t kLongest = 255;
  std::string name;
  for (char c; stream.read(&c, 1), c != 0;) {
    name += c;
    if (name.size() > kLongest)
      fail("{}: header: expected a name of at most {} letters, found a longer one", file, kLongest);
  }
  return name;
}

// One attribute's place in the file.
struct Value {
  std::string file, name;
  uint64_t at;
  int size;
};

void checkStrings(HeaderStream& stream, const Value& value) {
  for (uint64_t used = 0; used < uint64_t(value.size);) {
    const int length = readInt(stream);
    used += 4;
    if (length < 0 || used + uint64_t(length) > uint64_t(value.size))
      fail("{}: attribute {}: expected strings within {} bytes, found one of {}", value.file, value.name, value.size,
           uint32_t(length));
    used += uint64_t(length);
    stream.seekg(value.at + used);
  }
}

void checkChannels(HeaderStream& stream, const Value& value) {
  constexpr uint64_t kDescription = 16;  // behind each name
  const uint64_t end = value.at + uint64_t(value.size);
  bool ended = false;
  while (!ended && stream.tellg() < end) {
    ended = readName(stream, value.file).empty();
    if (!ended) stream.seekg(stream.tellg() + kDescription);
  }
  if (!ended || stream.tellg() != end)
    fail("{}: attribute {}: expected channels that end with its {} bytes, found others", value.file, value.name,
         value.size);
}

void checkValue(HeaderStream& stream, const std::string& type, const Value& value) {
  const auto fixed = kSizes.find(type);
  if (fixed != kSizes.end() && fixed->second != value.size)
    fail("{}: attribute {}: expected {} bytes for its type {}, found {}", value.file, value.name, fixed->second, type,
         value.size);
  if (type == "stringvector") checkStrings(stream, value);
  if (type == "chlist") checkChannels(stream, value);
}

}  // namespace

bool HeaderStream::read(char c[], int n) {
  const uint64_t size = uint64_t(std::max(n, 0));
  if (size <= kWindow && (at_ < begin_ || at_ + size > begin_ + window_.size())) fill();
  if (at_ >= begin_ && at_ + size <= begin_ + window_.size())
    std::memcpy(c, window_.data() + (at_ - begin_), size);
  else
    file_.read(at_, c, size);
  at_ += size;
  return at_ < file_.size();
}

void HeaderStream::fill() {
  begin_ = std::min(at_, file_.size());
  window_.resize(size_t(std::min<uint64_t>(kWindow, file_.size() - begin_)));
  file_.read(begin_, window_.data(), window_.size());
}

int readInt(HeaderStream& stream) {
  unsigned char b[4];
  stream.read(reinterpret_cast<char*>(b), 4);
  return int(uint32_t(b[0]) | uint32_t(b[1]) << 8 | uint32_t(b[2]) << 16 | uint32_t(b[3]) << 24);
}

bool checkHeader(HeaderStream& stream, const InputFile& file) {
  const uint64_t begin = stream.tellg();
  bool any = false;
  for (std::string name; !(name = readName(stream, file.path())).empty(); any = true) {
    const std::string type = readName(stream, file.path());
    const int size = readInt(stream);
    const Value value{file.path(), printable(name), stream.tellg(), size};
    if (size < 0 || uint64_t(size) > file.size() - value.at)
      fail("{}: attribute {}: expected a size of at most {} bytes, found {}", value.file, value.name,
           file.size() - value.at, uint32_t(size));
    checkValue(stream, type, value);
    stream.seekg(value.at + uint64_t(size));
  }
  stream.seekg(begin);
  return any;
}

}  // namespace fathom::deep
