// Writes bands: the chunks of their rows are packed in parallel and appended in order.
#include <Imath/half.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfTileDescription.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cstring>

#include "base/error.h"
#include "deep/chunk_grid.h"
#include "deep/exr_output.h"
#include "flat/exr_codec.h"
#include "flat/parallel_in_order.h"

namespace fathom::deep {

namespace {

bool isTiled(const WriteOptions& options) {
  return options.tileWidth > 0 && options.tileHeight > 0;
}

// No tile is larger than the window.
ChunkGrid gridFor(const Box& window, const WriteOptions& options) {
  if (!isTiled(options)) return {window, window.width(), 1};
  return {window, std::min(options.tileWidth, window.width()), std::min(options.tileHeight, window.height())};
}

Imf::PixelType pixelType(PixelType type) {
  return type == PixelType::Uint ? Imf::UINT : type == PixelType::Half ? Imf::HALF : Imf::FLOAT;
}

Imf::Compression compressionOf(const std::string& path, Compression compression) {
  switch (compression) {
    case Compression::None:
      return Imf::NO_COMPRESSION;
    case Compression::Rle:
      return Imf::RLE_COMPRESSION;
    case Compression::Zips:
      return Imf::ZIPS_COMPRESSION;
    default:
      fail("{}: expected compression none, rle or zips for a deep part, found another", path);
  }
}

Imath::Box2i toWindow(const Box& b) {
  return {{b.x0, b.y0}, {b.x1 - 1, b.y1 - 1}};
}

Imf::Header makeHeader(const std::string& path, const DeepImage& layout, const Box& dataWindow,
                       const WriteOptions& options) {
  Imf::Header header = layout.attributes.header();
  header.dataWindow() = toWindow(dataWindow);
  header.displayWindow() = toWindow(layout.displayWindow);
  header.compression() = compressionOf(path, options.compression);
  header.lineOrder() = Imf::INCREASING_Y;
  eraseAttribute(header, "tiles");
  const ChunkGrid grid = gridFor(dataWindow, options);
  if (isTiled(options)) header.setTileDescription(Imf::TileDescription(unsigned(grid.width), unsigned(grid.height)));
  header.setType(isTiled(options) ? Imf::DEEPTILE : Imf::DEEPSCANLINE);
  eraseAttribute(header, "version");
  header.setVersion(1);
  header.channels() = Imf::ChannelList();
  for (const Channel& c : layout.channels) {
    if (header.channels().findChannel(c.name))
      fail("{}, channel {}: expected once, found twice", path, printable(c.name));
    header.channels().insert(c.name, Imf::Channel(pixelType(c.type)));
  }
  return header;
}

// Checks what is to be written, before the file is opened.
Imf::Header checkedHeader(const std::string& path, const DeepImage& layout, const Box& dataWindow,
                          const WriteOptions& options) {
  if (dataWindow.empty()) fail("{}: expected pixels, found an empty data window", path);
  if (layout.channels.empty()) fail("{}: expected channels, found none", path);
  return makeHeader(path, layout, dataWindow, options);
}

}  // namespace

struct Writer::Impl {
  Impl(const std::string& path, const DeepImage& layout, const Box& window, const WriteOptions& opts)
      : options(opts),
        grid(gridFor(window, opts)),
        nextRow(window.y0),
        output(path, checkedHeader(path, layout, window, opts), chunksOf(window), opts.otherPartsOf,
               opts.replacedPart) {
    for (const Channel& c : layout.channels) channels.push_back({c.name, c.type});
    // As they stand in the file.
    std::sort(channels.begin(), channels.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  }

  size_t chunksOf(const Box& window) const { return window.empty() ? 0 : size_t(grid.columns()) * size_t(grid.rows()); }

  // Rows that wait for the rest of their tiles, then the new ones.
  using Sources = std::vector<const DeepImage*>;

  void write(const DeepImage& band) {
    check(band);
    Sources sources;
    for (const DeepImage& image : pending) sources.push_back(&image);
    sources.push_back(&band);
    nextRow = band.dataWindow.y1;
    const int lastRow = nextRow == grid.window.y1 ? grid.rows() : grid.rowOf(nextRow);
    writeChunks(sources, lastRow);
    const int done = std::min(grid.window.y0 + lastRow * grid.height, grid.window.y1);
    std::erase_if(pending, [&](const DeepImage& image) { return image.dataWindow.y1 <= done; });
    if (done < nextRow) pending.push_back(rows(band, std::max(done, band.dataWindow.y0), nextRow));
  }

  void check(const DeepImage& band) const {
    const Box &w = band.dataWindow, &all = grid.window;
    if (w.x0 != all.x0 || w.x1 != all.x1 || w.y0 != nextRow || w.y1 > all.y1)
      fail("{}: expected rows from {} on, columns {} to {}; found rows from {} on, columns {} to {}", output.path(),
           nextRow, all.x0, all.x1, w.y0, w.x0, w.x1);
    for (const ChannelInfo& c : channels) {
      const Channel* channel = band.find(c.name);
      if (!channel || channel->type != c.type)
        fail("{}, channel {}: expected in every band as in the first", output.path(), printable(c.name));
      if (channel->size() < band.samples())
        fail("{}, channel {}: expected {} values, found {}", output.path(), printable(c.name), band.samples(),
             channel->size());
    }
  }

  void writeChunks(const Sources& sources, int lastRow) {
    const size_t last = size_t(lastRow) * size_t(grid.columns());
    parallelInOrder(
        nextChunk, last, [&](size_t chunk) { return packChunk(sources, chunk); },
        [&](size_t chunk, const Bytes& bytes) { output.append(chunk, bytes); });
    nextChunk = last;
  }

  struct Scratch {
    Packer packer;
    Bytes counts, samples;
    uint32_t most = 0;
  };

  Bytes packChunk(const Sources& sources, size_t number) {
    const int column = int(number % size_t(grid.columns())), row = int(number / size_t(grid.columns()));
    const Box box = grid.box(column, row);
    Scratch& local = scratch.local();
    local.counts.clear();
    local.samples.clear();
    for (const DeepImage* image : sources)
      for (int y = std::max(box.y0, image->dataWindow.y0); y < std::min(box.y1, image->dataWindow.y1); ++y)
        addRow(*image, box, y, local);

    Bytes bytes;
    if (output.multiPart()) put(bytes, int32_t(output.part()));
    if (isTiled(options))
      for (int32_t place : {column, row, 0, 0}) put(bytes, place);  // and the level
    else
      put(bytes, int32_t(box.y0));
    const size_t sizesAt = bytes.size();
    grow(bytes, 3 * sizeof(uint64_t));
    const size_t countsAt = bytes.size();
    local.packer.pack(options.compression, local.counts, grid.tableBytes(), bytes);
    const size_t samplesAt = bytes.size();
    local.packer.pack(options.compression, local.samples, local.samples.size(), bytes);
    const uint64_t sizes[] = {samplesAt - countsAt, bytes.size() - samplesAt, local.samples.size()};
    std::memcpy(bytes.data() + sizesAt, sizes, sizeof(sizes));
    return bytes;
  }

  void addRow(const DeepImage& image, const Box& box, int y, Scratch& local) const {
    const uint64_t* offsets = image.offsets.data() + image.dataWindow.index(box.x0, y);
    const uint64_t first = offsets[0], last = offsets[box.width()];
    if (last - first > uint64_t(INT32_MAX))
      fail("{}, row {}: expected at most {} samples, found {}", output.path(), y, INT32_MAX, last - first);
    const size_t n = size_t(last - first);
    auto* sums = reinterpret_cast<uint32_t*>(grow(local.counts, 4 * size_t(box.width())));
    for (int x = 0; x < box.width(); ++x) {
      sums[x] = uint32_t(offsets[x + 1] - first);
      local.most = std::max(local.most, uint32_t(offsets[x + 1] - offsets[x]));
    }
    if (n == 0) return;
    for (const ChannelInfo& c : channels) {
      const Channel& channel = *image.find(c.name);
      uint8_t* to = grow(local.samples, n * (valueBytes(c.type)));
      if (c.type == PixelType::Uint)
        std::memcpy(to, channel.ids.data() + first, 4 * n);
      else if (c.type == PixelType::Float)
        std::memcpy(to, channel.values.data() + first, 4 * n);
      else
        putHalf({channel.values.data() + first, n}, to);
    }
  }

  void finish() {
    if (nextRow != grid.window.y1)
      fail("{}: expected rows up to {}, found them up to {}", output.path(), grid.window.y1, nextRow);
    uint32_t most = 0;
    for (const Scratch& local : scratch) most = std::max(most, local.most);
    output.finish(most);
  }

  WriteOptions options;
  ChunkGrid grid;
  int nextRow;
  size_t nextChunk = 0;
  ExrOutput output;
  std::vector<ChannelInfo> channels;
  std::vector<DeepImage> pending;
  tbb::enumerable_thread_specific<Scratch> scratch;
};

Writer::Writer(const std::string& path, const DeepImage& layout, const Box& dataWindow, const WriteOptions& options)
    : impl_(std::make_unique<Impl>(path, layout, dataWindow, options)) {}
Writer::Writer(Writer&&) noexcept = default;
Writer::~Writer() = default;

void Writer::write(const DeepImage& band) {
  impl_->write(band);
}
void Writer::finish() {
  impl_->finish();
}

void write(const std::string& path, const DeepImage& image, const WriteOptions& options) {
  Writer writer(path, image, image.dataWindow, options);
  writer.write(image);
  writer.finish();
}

}  // namespace fathom::deep
