// The structure of an EXR file: its headers, where the chunks of a part lie, and bytes from a position.
//
// OpenEXR's library reads the headers (it knows every type of attribute); the chunks are ours (deep/chunk_reader),
// because that is two to five times as fast as the library's deep reader (tests/bench/io_bench) and every size is
// checked before anything is allocated. Before a header goes to the library, its attributes are walked and their sizes
// checked against the file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "deep/io.h"

namespace fathom::deep {

// A regular file that is read at positions, from any number of threads.
class InputFile {
 public:
  explicit InputFile(const std::string& path);
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;
  ~InputFile();

  const std::string& path() const { return path_; }
  uint64_t size() const { return size_; }
  // Throws an Error that names the file when it ends before `offset + size`.
  void read(uint64_t offset, void* to, size_t size) const;

 private:
  std::string path_;
  int fd_ = -1;
  uint64_t size_ = 0;
};

class ExrFile {
 public:
  explicit ExrFile(const std::string& path);

  const InputFile& bytes() const { return file_; }
  const std::vector<PartInfo>& parts() const { return parts_; }
  bool multiPart() const { return multiPart_; }
  // "a.exr" or "a.exr, part 2": how an error begins.
  std::string where(const PartInfo& part) const;

  // The offset table of a part, as it stands in the file.
  std::vector<uint64_t> chunkTable(const PartInfo& part) const;

 private:
  void readHeaders();
  uint64_t chunkCount(const PartInfo& part) const;

  InputFile file_;
  std::vector<PartInfo> parts_;
  bool multiPart_ = false;
  uint64_t tables_ = 0;  // where the offset tables begin
};

}  // namespace fathom::deep
