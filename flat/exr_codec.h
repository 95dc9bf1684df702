// The bytes of an EXR chunk: none, RLE, ZIPS and ZIP, packed and unpacked.
//
// RLE and ZIPS reorder the bytes before they pack them: those at even places first, then those at odd places, then each
// as the difference to the one before. Every value has an even number of bytes, so a channel can be put together from
// the two halves without undoing the order for the channels around it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/buffer.h"
#include "flat/exr_types.h"

struct libdeflate_compressor;
struct libdeflate_decompressor;

namespace fathom {

// Of a value in the file.
inline size_t valueBytes(PixelType type) {
  return type == PixelType::Half ? 2 : 4;
}

// The most bytes that `packed` bytes can unpack to.
uint64_t mostUnpacked(Compression compression, uint64_t packed);

// Unpacked bytes; valid while the Unpacker's are. Offsets and sizes are even.
class Unpacked {
 public:
  Unpacked(std::span<const uint8_t> bytes, bool halved) : bytes_(bytes), halved_(halved) {}

  // 32-bit values that begin at a byte offset.
  void copy(size_t offset, std::span<uint32_t> to) const;
  void copy(size_t offset, std::span<float> to) const;
  // 16-bit floats that begin at a byte offset.
  void copyHalf(size_t offset, std::span<float> to) const;

 private:
  void copyBytes(size_t offset, uint8_t* to, size_t size) const;

  std::span<const uint8_t> bytes_;
  bool halved_;
};

// Holds its scratch: one per thread.
class Unpacker {
 public:
  Unpacker();
  ~Unpacker();

  // Unpacks to exactly `size` bytes; throws an Error without a file ("expected ..., found ...") where that fails.
  // `rawSize` (at least `size`) is how many bytes there are where they are not packed: a tile at the edge of the window
  // has a table of counts as long as a whole tile's then. The result refers to `packed` or to scratch that the next
  // call overwrites.
  Unpacked unpack(Compression compression, std::span<const uint8_t> packed, size_t size, size_t rawSize);

 private:
  struct Free {
    void operator()(libdeflate_decompressor* p) const;
  };
  std::unique_ptr<libdeflate_decompressor, Free> inflate_;
  Buffer<uint8_t> scratch_;
};

class Packer {
 public:
  Packer();
  ~Packer();

  // Appends the packed bytes to `to`, or where these are not fewer than `rawSize` the bytes as they are, filled up with
  // zeros to `rawSize`.
  void pack(Compression compression, std::span<const uint8_t> bytes, size_t rawSize, std::vector<uint8_t>& to);

 private:
  struct Free {
    void operator()(libdeflate_compressor* p) const;
  };
  std::unique_ptr<libdeflate_compressor, Free> deflate_;
  Buffer<uint8_t> scratch_;
};

}  // namespace fathom
