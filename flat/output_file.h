// A file that is complete or not there: it is written beside its place and renamed by finish().
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace fathom {

class OutputFile {
 public:
  // Throws an Error where the folder is missing or read-only, or where something other than a file stands at `path`.
  explicit OutputFile(const std::string& path);
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile();

  const std::string& path() const { return path_; }
  // Appends; returns where the bytes begin.
  uint64_t append(std::span<const uint8_t> bytes);
  // Overwrites what was appended before.
  void overwrite(uint64_t offset, std::span<const uint8_t> bytes);
  void finish();

 private:
  std::string path_, temporary_;
  int fd_ = -1;
  uint64_t size_ = 0;
};

// Removes what killed processes left of a file that they were writing: theirs of this machine, and of other machines what
// nobody has touched for an hour.
void removeAbandoned(const std::string& path);

}  // namespace fathom
