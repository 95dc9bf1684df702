// A hash of everything that an output was made from, kept in the output, so that a run started again knows its own
// work.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace fathom::cli {

// FNV-1a, 64 bits. Every piece is preceded by its length, so that pieces do not run into one another.
class ContentHash {
 public:
  void add(std::string_view text);
  // The bytes of a file; throws Error where it cannot be read.
  void addFile(const std::string& path);
  uint64_t value() const { return value_; }

 private:
  void addBytes(const char* bytes, size_t size);

  uint64_t value_ = 0xcbf29ce484222325;
};

}  // namespace fathom::cli
