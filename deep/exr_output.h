// An EXR file that is being written: its headers and tables in front, chunks behind, other parts copied from another
// file.
#pragma once

#include <OpenEXR/ImfHeader.h>

#include <vector>

#include "deep/exr_file.h"
#include "flat/exr_bytes.h"
#include "flat/output_file.h"

namespace fathom::deep {

class ExrOutput {
 public:
  // `header` is that of the part to be written, of `chunks` chunks. Where `otherPartsOf` names a file, it takes the
  // place of that file's part `replacedPart` and its name, and the other parts are copied now.
  ExrOutput(const std::string& path, const Imf::Header& header, size_t chunks, const std::string& otherPartsOf,
            int replacedPart);

  const std::string& path() const { return file_.path(); }
  bool multiPart() const { return parts_.size() > 1; }
  int part() const { return int(own_); }

  // The bytes of a chunk of the part, from its part number (in a file of many parts) on.
  void append(size_t chunk, const Bytes& bytes) { parts_[own_].table[chunk] = file_.append(bytes); }
  // The file is complete; `mostSamples` is told in its header.
  void finish(uint32_t mostSamples);

 private:
  struct Part {
    Imf::Header header;
    std::vector<uint64_t> table;
  };

  void copyPart(const ExrFile& other, const PartInfo& part, std::vector<uint64_t>& table);
  void setMostSamples(uint32_t most);
  Bytes head() const;

  OutputFile file_;
  std::vector<Part> parts_;
  size_t own_ = 0;  // the part that is written here
};

}  // namespace fathom::deep
