// A hash of everything that an output was made from, kept in the output, so that a run started again knows its own
// work.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace fathom::cli {

// FNV-1a, 64 bits, in four lanes that take the bytes in turns: the multiplications of one byte need not wait for those
// of the last. Every piece is preceded by its length, so that pieces do not run into one another.
class ContentHash {
 public:
  void add(std::string_view text);
  // The bytes of a file; throws Error where it cannot be read.
  void addFile(const std::string& path);
  uint64_t value() const;

 private:
  static constexpr uint64_t kStart = 0xcbf29ce484222325, kPrime = 0x100000001b3;

  void addBytes(const char* bytes, size_t size);

  std::array<uint64_t, 4> lanes_ = {kStart, kStart, kStart, kStart};
};

}  // namespace fathom::cli
