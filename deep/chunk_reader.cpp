#include "deep/chunk_reader.h"

#include <algorithm>
#include <array>

#include "base/error.h"

namespace fathom::deep {

namespace {

template <class T>
std::span<T> sized(Buffer<T>& buffer, size_t size) {
  if (buffer.size() < size) buffer = Buffer<T>(size + size / 4);
  return {buffer.data(), size};
}

void checkCompression(const std::string& where, const PartInfo& part) {
  if (part.compression == Compression::Other || part.compression == Compression::Zip)
    fail("{}: expected compression none, rle or zips, found {}", where, part.compressionName);
}

}  // namespace

ChunkReader::ChunkReader(const ExrFile& file, const PartInfo& part)
    : file_(file), part_(part), where_(file.where(part)), grid_(gridOf(part)) {
  checkCompression(where_, part);
  table_ = file.chunkTable(part);
  for (const ChannelInfo& c : part.channels) sampleBytes_ += valueBytes(c.type);
}

Chunk ChunkReader::open(int column, int row) const {
  Chunk chunk;
  chunk.box = grid_.box(column, row);
  // The table goes from the top whatever the line order is, and begins with level 0.
  const uint64_t at = table_.at(size_t(row) * size_t(grid_.columns()) + size_t(column));
  if (at == 0) fail("{}: missing: the file was not finished", name(chunk));
  if (at > file_.bytes().size())
    fail("{}: damaged or truncated: expected at byte {} of a file of {}", name(chunk), at, file_.bytes().size());
  readHead(chunk, at, column, row);
  checkSizes(chunk);
  return chunk;
}

void ChunkReader::readHead(Chunk& chunk, uint64_t at, int column, int row) const {
  std::array<int32_t, 5> expected = {}, found = {};
  size_t n = 0;
  if (file_.multiPart()) expected[n++] = part_.number;
  if (part_.tiled)
    for (int32_t place : {column, row, 0, 0}) expected[n++] = place;  // and the level
  else
    expected[n++] = chunk.box.y0;
  std::array<uint64_t, 3> sizes;
  file_.bytes().read(at, found.data(), 4 * n);
  file_.bytes().read(at + 4 * n, sizes.data(), sizeof(sizes));
  if (found != expected) fail("{}: expected its start at byte {}, found something else", name(chunk), at);
  chunk.countsAt = at + 4 * n + sizeof(sizes);
  chunk.packedCounts = sizes[0];
  chunk.packedSamples = sizes[1];
  chunk.sampleBytes = sizes[2];
}

void ChunkReader::checkSizes(const Chunk& chunk) const {
  const uint64_t rest = file_.bytes().size() - chunk.countsAt;
  if (chunk.packedCounts > rest || chunk.packedSamples > rest - chunk.packedCounts)
    fail("{}: expected {} and {} bytes, found a file that ends after {}", name(chunk), chunk.packedCounts,
         chunk.packedSamples, rest);
  if (4 * chunk.box.area() > mostUnpacked(part_.compression, chunk.packedCounts))
    fail("{}: expected {} sample counts, found {} bytes of them", name(chunk), chunk.box.area(), chunk.packedCounts);
  if (chunk.sampleBytes > mostUnpacked(part_.compression, chunk.packedSamples))
    fail("{}: expected {} bytes of samples, found only {} packed bytes", name(chunk), chunk.sampleBytes,
         chunk.packedSamples);
}

std::string ChunkReader::name(const Chunk& chunk) const {
  if (!part_.tiled) return fmt::format("{}, row {}", where_, chunk.box.y0);
  return fmt::format("{}, tile at {} {}", where_, chunk.box.x0, chunk.box.y0);
}

void ChunkReader::readCounts(const Chunk& chunk, Scratch& scratch, uint32_t* counts, size_t stride) const {
  const std::span<uint8_t> packed = sized(scratch.packed, size_t(chunk.packedCounts));
  file_.bytes().read(chunk.countsAt, packed.data(), packed.size());
  const std::span<uint32_t> table = sized(scratch.table, chunk.box.area());
  unpack(chunk, scratch, packed, table.size_bytes(), grid_.tableBytes()).copy(0, table);
  // The file has running sums, which start anew in each row.
  uint64_t total = 0;
  const size_t width = size_t(chunk.box.width());
  for (size_t y = 0; y < size_t(chunk.box.height()); ++y) {
    const uint32_t* sums = table.data() + y * width;
    uint32_t before = 0;
    for (size_t x = 0; x < width; before = sums[x++]) {
      if (sums[x] < before)
        fail("{}: expected running sample counts of at least {}, found {}", name(chunk), before, sums[x]);
      counts[y * stride + x] = sums[x] - before;
    }
    total += before;
  }
  if (total > UINT64_MAX / sampleBytes_ || total * sampleBytes_ != chunk.sampleBytes)
    fail("{}: expected {} samples of {} bytes, found {} bytes", name(chunk), total, sampleBytes_, chunk.sampleBytes);
}

Unpacked ChunkReader::readSamples(const Chunk& chunk, Scratch& scratch) const {
  const std::span<uint8_t> packed = sized(scratch.packed, size_t(chunk.packedSamples));
  file_.bytes().read(chunk.countsAt + chunk.packedCounts, packed.data(), packed.size());
  return unpack(chunk, scratch, packed, size_t(chunk.sampleBytes), size_t(chunk.sampleBytes));
}

Unpacked ChunkReader::unpack(const Chunk& chunk, Scratch& scratch, std::span<const uint8_t> packed, size_t size,
                             size_t rawSize) const {
  try {
    return scratch.unpacker.unpack(part_.compression, packed, size, rawSize);
  } catch (const Error& e) {
    fail("{}: {}", name(chunk), e.what());
  }
}

}  // namespace fathom::deep
