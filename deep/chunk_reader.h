// The chunks of a deep part: where their bytes lie in the file, and how they become sample counts and samples.
//
// Sizes are checked against the file, and against what so many packed bytes can hold, before anything is allocated.
#pragma once

#include <string>
#include <vector>

#include "deep/chunk_grid.h"
#include "deep/exr_file.h"
#include "flat/exr_codec.h"

namespace fathom::deep {

struct Chunk {
  Box box;
  uint64_t countsAt = 0, packedCounts = 0;  // where the table of counts lies, and its bytes
  uint64_t packedSamples = 0;               // the bytes of the samples, right after the table
  uint64_t sampleBytes = 0;                 // the same, unpacked
};

class ChunkReader {
 public:
  // What a thread needs besides: one each.
  struct Scratch {
    Unpacker unpacker;
    Buffer<uint8_t> packed;
    Buffer<uint32_t> table;
  };

  // Refers to both; throws where the part is not what deep chunks are made of.
  ChunkReader(const ExrFile& file, const PartInfo& part);

  const ChunkGrid& grid() const { return grid_; }
  size_t sampleBytes() const { return sampleBytes_; }  // of one sample, all channels

  Chunk open(int column, int row) const;
  // The sample counts of the chunk's pixels, row by row into rows that are `stride` apart.
  void readCounts(const Chunk& chunk, Scratch& scratch, uint32_t* counts, size_t stride) const;
  // The samples: for each row of pixels and then each channel the values of all samples of the row.
  Unpacked readSamples(const Chunk& chunk, Scratch& scratch) const;

 private:
  std::string name(const Chunk& chunk) const;
  void readHead(Chunk& chunk, uint64_t at, int column, int row) const;
  void checkSizes(const Chunk& chunk) const;
  Unpacked unpack(const Chunk& chunk, Scratch& scratch, std::span<const uint8_t> packed, size_t size,
                  size_t rawSize) const;

  const ExrFile& file_;
  const PartInfo& part_;
  std::string where_;
  ChunkGrid grid_;
  std::vector<uint64_t> table_;
  size_t sampleBytes_ = 0;
};

}  // namespace fathom::deep
