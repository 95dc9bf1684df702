// What OpenEXR reads the headers of a file from, and a look at them before it does: its C++ library takes sizes as they are.
#pragma once

#include <OpenEXR/ImfIO.h>

#include <cstdint>
#include <vector>

#include "deep/exr_file.h"

namespace fathom::deep {

class HeaderStream : public Imf::IStream {
 public:
  explicit HeaderStream(const InputFile& file) : IStream(file.path().c_str()), file_(file) {}

  bool read(char c[], int n) override;
  uint64_t tellg() override { return at_; }
  void seekg(uint64_t at) override { at_ = at; }

 private:
  static constexpr size_t kWindow = 65536;

  void fill();

  const InputFile& file_;
  std::vector<char> window_;
  uint64_t begin_ = 0, at_ = 0;
};

int readInt(HeaderStream& stream);

// Walks the attributes of one header and leaves the stream where it was. Throws Error where a size does not fit into the
// file, or is not that of what is in it: OpenEXR would then go on reading in another place than this did. False for the empty
// header that ends a list.
bool checkHeader(HeaderStream& stream, const InputFile& file);

}  // namespace fathom::deep
