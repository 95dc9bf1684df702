// Reads deep chunks: all sample counts of a band first, which are checked against the file and the memory limit, then
// the values.
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfHeader.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cstring>
#include <numeric>

#include "deep/exr_codec.h"
#include "deep/exr_file.h"
#include "flat/error.h"
#include "flat/parallel.h"

namespace fathom::deep {

namespace {

size_t valueBytes(PixelType type) {
  return type == PixelType::Half ? 2 : 4;
}

struct Scratch {
  Unpacker unpacker;
  Buffer<uint8_t> packed;
  Buffer<uint32_t> table;

  std::span<uint8_t> packedBytes(size_t size) {
    if (packed.size() < size) packed = Buffer<uint8_t>(size + size / 4);
    return {packed.data(), size};
  }
  std::span<uint32_t> tableOf(size_t pixels) {
    if (table.size() < pixels) table = Buffer<uint32_t>(pixels);
    return {table.data(), pixels};
  }
};

// A row, or a tile of level 0.
struct Chunk {
  Box box;
  uint64_t countsAt = 0, packedCounts = 0;  // where the table of counts lies, and its bytes
  uint64_t packedSamples = 0;               // the bytes of the samples, right after the table
  uint64_t sampleBytes = 0;                 // the same, unpacked
};

const PartInfo& choosePart(const ExrFile& file, const std::string& wanted) {
  const std::vector<PartInfo>& parts = file.parts();
  auto it = std::find_if(parts.begin(), parts.end(),
                         [&](const PartInfo& part) { return wanted.empty() ? part.deep : part.name == wanted; });
  const bool number =
      !wanted.empty() && wanted.size() < 9 && wanted.find_first_not_of("0123456789") == std::string::npos;
  if (it == parts.end() && number && size_t(std::stoi(wanted)) < parts.size()) it = parts.begin() + std::stoi(wanted);
  if (it == parts.end() && wanted.empty()) fail("{}: expected a deep part, found flat ones", file.bytes().path());
  if (it == parts.end()) fail("{}: expected a part {}, found {} parts", file.bytes().path(), wanted, parts.size());
  if (!it->deep) fail("{}: expected a deep part, found a flat one", file.where(*it));
  return *it;
}

void checkLayout(const std::string& where, const PartInfo& part) {
  if (part.compression == Compression::Other || part.compression == Compression::Zip)
    fail("{}: expected compression none, rle or zips, found {}", where, part.compressionName);
  const Imf::ChannelList& channels = part.attributes.header().channels();
  for (auto c = channels.begin(); c != channels.end(); ++c)
    if (c.channel().xSampling != 1 || c.channel().ySampling != 1)
      fail("{}, channel {}: expected sampling 1 1, found {} {}", where, printable(c.name()), c.channel().xSampling,
           c.channel().ySampling);
}

}  // namespace

struct Reader::Impl {
  Impl(const std::string& path, ReadOptions opts)
      : file(path), options(std::move(opts)), part(choosePart(file, options.part)), where(file.where(part)) {
    checkLayout(where, part);
    table = file.chunkTable(part);
    for (const ChannelInfo& c : part.channels) pixelBytes += valueBytes(c.type);
  }

  Box rowsOf(int y0, int y1) const {
    const Box& w = part.dataWindow;
    if (y0 < w.y0 || y1 > w.y1 || y0 > y1)
      fail("{}: expected rows within {} to {}, found {} to {}", where, w.y0, w.y1, y0, y1);
    return {w.x0, y0, w.x1, y1};
  }

  // The rows that the chunks of a band cover.
  Box wholeChunks(const Box& band) const {
    if (!part.tiled || band.height() == 0) return band;
    const auto& w = part.dataWindow;
    const int first = w.y0 + (band.y0 - w.y0) / part.tileHeight * part.tileHeight;
    const int64_t last =
        int64_t(w.y0) + (int64_t(band.y1 - w.y0) + part.tileHeight - 1) / part.tileHeight * part.tileHeight;
    return {w.x0, first, w.x1, int(std::min<int64_t>(last, w.y1))};
  }

  void limit(const Box& band, double bytes, const char* what) const {
    if (bytes > double(options.memoryLimit))
      fail("{}, rows {} to {}: {} would take {:.0f} MB, more than the memory limit of {:.0f} MB", where, band.y0,
           band.y1 - 1, what, bytes / 1e6, double(options.memoryLimit) / 1e6);
  }

  Chunk openChunk(int tx, int ty) const {
    const Box& w = part.dataWindow;
    const int tw = part.tiled ? part.tileWidth : w.width(), th = part.tiled ? part.tileHeight : 1;
    const int columns = (w.width() - 1) / tw + 1;
    Chunk chunk;
    chunk.box.x0 = w.x0 + tx * tw;
    chunk.box.y0 = w.y0 + ty * th;
    chunk.box.x1 = int(std::min<int64_t>(w.x1, int64_t(chunk.box.x0) + tw));
    chunk.box.y1 = int(std::min<int64_t>(w.y1, int64_t(chunk.box.y0) + th));
    // The table is in file order: a tile's place does not depend on the line order, a row's neither.
    const uint64_t at = table.at(size_t(ty) * size_t(columns) + size_t(tx));
    if (at == 0) fail("{}: missing: the file was not finished", name(chunk));
    if (at > file.bytes().size())
      fail("{}: damaged or truncated: expected at byte {} of a file of {}", name(chunk), at, file.bytes().size());
    readChunkHead(chunk, at, {tx, ty, 0, 0});
    return chunk;
  }

  void readChunkHead(Chunk& chunk, uint64_t at, std::array<int32_t, 4> tile) const {
    std::array<int32_t, 5> expected = {}, found = {};
    size_t n = 0;
    if (file.multiPart()) expected[n++] = part.number;
    if (part.tiled)
      for (int32_t t : tile) expected[n++] = t;
    else
      expected[n++] = chunk.box.y0;
    std::array<uint64_t, 3> sizes;
    file.bytes().read(at, found.data(), 4 * n);
    file.bytes().read(at + 4 * n, sizes.data(), sizeof(sizes));
    if (found != expected) fail("{}: expected its start at byte {}, found something else", name(chunk), at);
    chunk.countsAt = at + 4 * n + sizeof(sizes);
    chunk.packedCounts = sizes[0];
    chunk.packedSamples = sizes[1];
    chunk.sampleBytes = sizes[2];
    checkSizes(chunk);
  }

  void checkSizes(const Chunk& chunk) const {
    const uint64_t rest = file.bytes().size() - std::min(file.bytes().size(), chunk.countsAt);
    if (chunk.packedCounts > rest || chunk.packedSamples > rest - chunk.packedCounts)
      fail("{}: expected {} and {} bytes, found a file that ends after {}", name(chunk), chunk.packedCounts,
           chunk.packedSamples, rest);
    if (4 * chunk.box.area() > mostUnpacked(part.compression, chunk.packedCounts))
      fail("{}: expected {} sample counts, found {} bytes of them", name(chunk), chunk.box.area(), chunk.packedCounts);
    if (chunk.sampleBytes > mostUnpacked(part.compression, chunk.packedSamples))
      fail("{}: expected {} bytes of samples, found only {} packed bytes", name(chunk), chunk.sampleBytes,
           chunk.packedSamples);
  }

  std::string name(const Chunk& chunk) const {
    if (!part.tiled) return fmt::format("{}, row {}", where, chunk.box.y0);
    return fmt::format("{}, tile at {} {}", where, chunk.box.x0, chunk.box.y0);
  }

  std::vector<Chunk> openChunks(const Box& area) const {
    std::vector<Chunk> chunks;
    if (area.empty()) return chunks;
    const Box& w = part.dataWindow;
    const int th = part.tiled ? part.tileHeight : 1, columns = part.tiled ? (w.width() - 1) / part.tileWidth + 1 : 1;
    for (int ty = (area.y0 - w.y0) / th; ty <= (area.y1 - 1 - w.y0) / th; ++ty)
      for (int tx = 0; tx < columns; ++tx) chunks.push_back(openChunk(tx, ty));
    return chunks;
  }

  // The sample counts of all pixels of some whole chunks, checked against what the chunks say they hold.
  Buffer<uint32_t> readCounts(const std::vector<Chunk>& chunks, const Box& area) {
    Buffer<uint32_t> counts(area.area());
    parallelFor(0, int(chunks.size()), [&](int i) { readCounts(chunks[size_t(i)], area, counts); });
    return counts;
  }

  void readCounts(const Chunk& chunk, const Box& area, Buffer<uint32_t>& counts) {
    Scratch& local = scratch.local();
    const std::span<uint8_t> packed = local.packedBytes(size_t(chunk.packedCounts));
    file.bytes().read(chunk.countsAt, packed.data(), packed.size());
    const std::span<uint32_t> sums = local.tableOf(chunk.box.area());
    const size_t fullTable = 4 * (part.tiled ? size_t(part.tileWidth) * size_t(part.tileHeight) : sums.size());
    unpack(chunk, local, packed, sums.size_bytes(), fullTable).copy(0, sums);
    uint64_t total = 0;
    for (int y = chunk.box.y0; y < chunk.box.y1; ++y) {
      const uint32_t* row = sums.data() + chunk.box.index(chunk.box.x0, y);
      uint32_t* to = counts.data() + area.index(chunk.box.x0, y);
      uint32_t before = 0;
      for (int x = 0; x < chunk.box.width(); before = row[x++]) {
        if (row[x] < before)
          fail("{}: expected running sample counts of at least {}, found {}", name(chunk), before, row[x]);
        to[x] = row[x] - before;
      }
      total += before;
    }
    if (total > UINT64_MAX / pixelBytes || total * pixelBytes != chunk.sampleBytes)
      fail("{}: expected {} samples of {} bytes, found {} bytes", name(chunk), total, pixelBytes, chunk.sampleBytes);
  }

  Unpacked unpack(const Chunk& chunk, Scratch& local, std::span<const uint8_t> packed, size_t size,
                  size_t rawSize) const {
    try {
      return local.unpacker.unpack(part.compression, packed, size, rawSize);
    } catch (const Error& e) {
      fail("{}: {}", name(chunk), e.what());
    }
  }

  // The channels that the caller asked for, and where each begins in a row of samples, in bytes per sample.
  struct Wanted {
    Channel* channel;
    size_t before;
  };

  void readSamples(const Chunk& chunk, const Box& area, const Buffer<uint32_t>& counts,
                   const std::vector<Wanted>& wanted, DeepImage& image) {
    const Box inside = intersect(chunk.box, image.dataWindow);
    Scratch& local = scratch.local();
    const std::span<uint8_t> packed = local.packedBytes(size_t(chunk.packedSamples));
    file.bytes().read(chunk.countsAt + chunk.packedCounts, packed.data(), packed.size());
    const Unpacked samples = unpack(chunk, local, packed, size_t(chunk.sampleBytes), size_t(chunk.sampleBytes));
    size_t at = 0;
    for (int y = chunk.box.y0; y < inside.y1; ++y) {
      const uint32_t* row = counts.data() + area.index(chunk.box.x0, y);
      const size_t n = std::accumulate(row, row + chunk.box.width(), size_t(0));
      if (y >= inside.y0) {
        const size_t first = size_t(image.offsets[image.dataWindow.index(chunk.box.x0, y)]);
        for (const Wanted& w : wanted) copyRow(samples, at + n * w.before, first, n, *w.channel);
      }
      at += n * pixelBytes;
    }
  }

  static void copyRow(const Unpacked& samples, size_t at, size_t first, size_t n, Channel& to) {
    if (to.type == PixelType::Uint)
      samples.copy(at, std::span<uint32_t>(to.ids.data() + first, n));
    else if (to.type == PixelType::Float)
      samples.copy(at, std::span<float>(to.values.data() + first, n));
    else
      samples.copyHalf(at, std::span<float>(to.values.data() + first, n));
  }

  std::vector<Wanted> addChannels(DeepImage& image) const {
    std::vector<size_t> before;
    size_t sum = 0;
    for (const ChannelInfo& c : part.channels) {
      if (!options.channels || options.channels(c.name)) {
        image.add(c.name, c.type);
        before.push_back(sum);
      }
      sum += valueBytes(c.type);
    }
    std::vector<Wanted> result;
    for (size_t i = 0; i < before.size(); ++i) result.push_back({&image.channels[i], before[i]});
    return result;
  }

  size_t wantedBytes() const {
    size_t bytes = 0;
    for (const ChannelInfo& c : part.channels)
      if (!options.channels || options.channels(c.name)) bytes += 4;
    return bytes;
  }

  ExrFile file;
  ReadOptions options;
  const PartInfo& part;
  std::string where;
  std::vector<uint64_t> table;
  size_t pixelBytes = 0;  // of one sample in the file
  tbb::enumerable_thread_specific<Scratch> scratch;
};

Reader::Reader(const std::string& path, ReadOptions options)
    : impl_(std::make_unique<Impl>(path, std::move(options))) {}
Reader::Reader(Reader&&) noexcept = default;
Reader::~Reader() = default;

const PartInfo& Reader::part() const {
  return impl_->part;
}

Buffer<uint32_t> Reader::sampleCounts(int y0, int y1) {
  const Box band = impl_->rowsOf(y0, y1), area = impl_->wholeChunks(band);
  impl_->limit(band, 4.0 * double(area.area()), "sample counts");
  Buffer<uint32_t> all = impl_->readCounts(impl_->openChunks(area), area);
  if (band == area) return all;
  Buffer<uint32_t> result(band.area());
  std::copy_n(all.data() + area.index(area.x0, y0), result.size(), result.data());
  return result;
}

int Reader::bandEnd(int y0, size_t bytes) {
  const Box& window = impl_->part.dataWindow;
  const size_t width = size_t(window.width());
  const int step = impl_->part.tiled ? impl_->part.tileHeight : 16;
  double used = 0;
  for (int y = y0; y < window.y1;) {
    const int next =
        int(std::min<int64_t>(window.y1, int64_t(impl_->wholeChunks({window.x0, y, window.x1, y + 1}).y0) + step));
    const Buffer<uint32_t> counts = sampleCounts(y, next);
    for (int row = 0; row < next - y; ++row) {
      const uint32_t* first = counts.data() + size_t(row) * width;
      const double samples = std::accumulate(first, first + width, 0.0);
      used += 12.0 * double(width) + samples * double(impl_->wantedBytes());
      const int place = impl_->part.tiled ? y : y + row;
      if (used > double(bytes) && place > y0) return place;
    }
    y = next;
  }
  return window.y1;
}

DeepImage Reader::read(int y0, int y1) {
  const Box band = impl_->rowsOf(y0, y1), area = impl_->wholeChunks(band);
  impl_->limit(band, 12.0 * double(area.area()), "sample counts");
  const std::vector<Chunk> chunks = impl_->openChunks(area);
  const Buffer<uint32_t> counts = impl_->readCounts(chunks, area);

  DeepImage image{band, impl_->part.displayWindow, Buffer<uint64_t>(band.area() + 1), {}, impl_->part.attributes};
  const uint32_t* inBand = counts.data() + (band.empty() ? 0 : area.index(area.x0, y0));
  image.offsets[0] = 0;
  for (size_t i = 0; i < band.area(); ++i) image.offsets[i + 1] = image.offsets[i] + inBand[i];
  impl_->limit(band, 12.0 * double(area.area()) + double(image.samples()) * double(impl_->wantedBytes()), "samples");
  for (const Chunk& chunk : chunks) impl_->limit(chunk.box, double(chunk.sampleBytes), "samples");

  const std::vector<Impl::Wanted> wanted = impl_->addChannels(image);
  if (!wanted.empty())
    parallelFor(0, int(chunks.size()),
                [&](int i) { impl_->readSamples(chunks[size_t(i)], area, counts, wanted, image); });
  return image;
}

DeepImage Reader::read() {
  return read(impl_->part.dataWindow.y0, impl_->part.dataWindow.y1);
}

DeepImage read(const std::string& path, const ReadOptions& options) {
  return Reader(path, options).read();
}

}  // namespace fathom::deep
