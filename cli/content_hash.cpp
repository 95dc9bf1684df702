#include "cli/content_hash.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <vector>

#include "base/error.h"

namespace fathom::cli {

void ContentHash::addBytes(const char* bytes, size_t size) {
  std::array<uint64_t, 4> lanes = lanes_;
  size_t i = 0;
  for (; i + 4 <= size; i += 4)
    for (size_t lane = 0; lane < 4; ++lane) lanes[lane] = (lanes[lane] ^ uint8_t(bytes[i + lane])) * kPrime;
  for (size_t lane = 0; i + lane < size; ++lane) lanes[lane] = (lanes[lane] ^ uint8_t(bytes[i + lane])) * kPrime;
  lanes_ = lanes;
}

uint64_t ContentHash::value() const {
  uint64_t value = kStart;
  for (const uint64_t lane : lanes_)
    for (int shift = 0; shift < 64; shift += 8) value = (value ^ (lane >> shift & 0xff)) * kPrime;
  return value;
}

void ContentHash::add(std::string_view text) {
  const std::string length = fmt::format("{}:", text.size());
  addBytes(length.data(), length.size());
  addBytes(text.data(), text.size());
}

void ContentHash::addFile(const std::string& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (error) fail("{}: expected a file that can be read, found: {}", path, error.message());  // a named pipe would wait
  std::ifstream file(path, std::ios::binary);
  if (!file) fail("{}: expected a file that can be read, found: {}", path, std::strerror(errno));
  const std::string length = fmt::format("{}:", size);
  addBytes(length.data(), length.size());
  std::vector<char> block(size_t(1) << 20);
  while (file.read(block.data(), std::streamsize(block.size())) || file.gcount() > 0)
    addBytes(block.data(), size_t(file.gcount()));
  if (file.bad()) fail("{}: expected {} bytes, found an error while reading", path, size);
}

}  // namespace fathom::cli
