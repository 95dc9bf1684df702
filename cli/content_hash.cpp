#include "cli/content_hash.h"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "flat/error.h"

namespace fathom::cli {

void ContentHash::addBytes(const char* bytes, size_t size) {
  for (size_t i = 0; i < size; ++i) value_ = (value_ ^ uint8_t(bytes[i])) * 0x100000001b3;
}

void ContentHash::add(std::string_view text) {
  const std::string length = fmt::format("{}:", text.size());
  addBytes(length.data(), length.size());
  addBytes(text.data(), text.size());
}

void ContentHash::addFile(const std::string& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  if (error || !file) fail("{}: expected a file that can be read, found {}", path, error ? error.message() : "none");
  const std::string length = fmt::format("{}:", size);
  addBytes(length.data(), length.size());
  std::vector<char> block(size_t(1) << 20);
  while (file.read(block.data(), std::streamsize(block.size())) || file.gcount() > 0)
    addBytes(block.data(), size_t(file.gcount()));
  if (file.bad()) fail("{}: expected {} bytes, found an error while reading", path, size);
}

}  // namespace fathom::cli
