// Writes deep chunks: rows are packed in parallel and appended in order, the header and the tables come last.
#include <Imath/half.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfTileDescription.h>
#include <OpenEXR/ImfVersion.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstring>
#include <set>

#include "deep/exr_codec.h"
#include "deep/exr_file.h"
#include "flat/error.h"
#include "flat/output_file.h"

namespace fathom::deep {

namespace {

using Bytes = std::vector<uint8_t>;

// Room for `size` more bytes at the end.
uint8_t* grow(Bytes& bytes, size_t size) {
  bytes.resize(bytes.size() + size);
  return bytes.data() + bytes.size() - size;
}

template <class T>
void put(Bytes& to, const T& value) {
  std::memcpy(grow(to, sizeof(T)), &value, sizeof(T));
}

// What OpenEXR writes a header to.
class HeaderBytes : public Imf::OStream {
 public:
  explicit HeaderBytes(Bytes& bytes) : OStream("header"), bytes_(bytes) {}
  void write(const char c[], int n) override { std::memcpy(grow(bytes_, size_t(n)), c, size_t(n)); }
  uint64_t tellp() override { return bytes_.size(); }
  void seekp(uint64_t) override { throw std::logic_error("a header is written in order"); }

 private:
  Bytes& bytes_;
};

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
  const bool tiled = options.tileWidth > 0 && options.tileHeight > 0;
  if (tiled) header.setTileDescription(Imf::TileDescription(unsigned(options.tileWidth), unsigned(options.tileHeight)));
  header.setType(tiled ? Imf::DEEPTILE : Imf::DEEPSCANLINE);
  eraseAttribute(header, "version");
  header.setVersion(1);
  header.channels() = Imf::ChannelList();
  for (const Channel& c : layout.channels) {
    if (header.channels().findChannel(c.name)) fail("{}, channel {}: expected once, found twice", path, c.name);
    header.channels().insert(c.name, Imf::Channel(pixelType(c.type)));
  }
  return header;
}

bool hasLongNames(const Imf::Header& header) {
  constexpr size_t kShort = 31;
  const auto isLong = [](const char* name) { return std::strlen(name) > kShort; };
  for (auto a = header.begin(); a != header.end(); ++a)
    if (isLong(a.name()) || isLong(a.attribute().typeName())) return true;
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c)
    if (isLong(c.name())) return true;
  return false;
}

// The bytes of a chunk in a file of many parts, from its part number on.
uint64_t chunkBytes(const ExrFile& file, const PartInfo& part, uint64_t at) {
  const uint64_t head = 4 + (part.tiled ? 16 : 4);
  if (!part.deep) {
    uint32_t size;
    file.bytes().read(at + head, &size, sizeof(size));
    return head + sizeof(size) + size;
  }
  uint64_t sizes[3];
  file.bytes().read(at + head, sizes, sizeof(sizes));
  const uint64_t rest = file.bytes().size() - at - head - sizeof(sizes);
  if (sizes[0] > rest || sizes[1] > rest - sizes[0])
    fail("{}: expected {} and {} bytes in a chunk, found a file that ends after {}", file.where(part), sizes[0],
         sizes[1], rest);
  return head + sizeof(sizes) + sizes[0] + sizes[1];
}

// One part of the new file.
struct Part {
  Imf::Header header;
  std::vector<uint64_t> table;
};

}  // namespace

struct Writer::Impl {
  Impl(const std::string& path, const DeepImage& layout, const Box& window, const WriteOptions& opts)
      : file(path), options(opts), dataWindow(window), nextRow(window.y0) {
    tiled = options.tileWidth > 0 && options.tileHeight > 0;
    options.tileWidth = std::min(options.tileWidth, dataWindow.width());
    options.tileHeight = std::min(options.tileHeight, dataWindow.height());
    if (dataWindow.empty()) fail("{}: expected pixels, found an empty data window", path);
    if (layout.channels.empty()) fail("{}: expected channels, found none", path);
    Imf::Header header = makeHeader(path, layout, dataWindow, options);
    for (auto c = header.channels().begin(); c != header.channels().end(); ++c)
      channels.push_back({c.name(), layout.find(c.name())->type});
    if (tiled) {
      columns = (dataWindow.width() - 1) / options.tileWidth + 1;
      tileRows = options.tileHeight;
    }
    const int chunkRows = (dataWindow.height() - 1) / tileRows + 1;
    addParts(std::move(header), size_t(columns) * size_t(chunkRows));
  }

  void addParts(Imf::Header header, size_t chunks) {
    std::optional<ExrFile> other;
    if (!options.otherPartsOf.empty()) other.emplace(options.otherPartsOf);
    const size_t count = other ? other->parts().size() : 1;
    if (size_t(options.replacedPart) >= count)
      fail("{}: expected part {}, found {} parts", options.otherPartsOf, options.replacedPart, count);
    own = other ? size_t(options.replacedPart) : 0;
    for (size_t i = 0; i < count; ++i) {
      if (i == own)
        parts.push_back({std::move(header), std::vector<uint64_t>(chunks)});
      else
        parts.push_back({other->parts()[i].attributes.header(), other->chunkTable(other->parts()[i])});
      parts[i].header.setChunkCount(int(parts[i].table.size()));
    }
    if (count > 1) parts[own].header.setName(other->parts()[own].name);
    setMost(0);
    file.append(Bytes(head().size()));
    for (size_t i = 0; i < count; ++i)
      if (i != own) copyPart(*other, other->parts()[i], parts[i].table);
  }

  void copyPart(const ExrFile& other, const PartInfo& part, std::vector<uint64_t>& table) {
    if (!Imf::isSupportedType(part.attributes.header().type()))
      fail("{}: cannot copy a part of type {}", other.where(part), part.attributes.header().type());
    uint64_t copied = 0;
    Bytes chunk;
    for (uint64_t& at : table) {
      if (at == 0 || at > other.bytes().size()) fail("{}: cannot copy: the part was not finished", other.where(part));
      chunk.resize(size_t(std::min(chunkBytes(other, part, at), other.bytes().size())));
      copied += chunk.size();
      if (copied > other.bytes().size()) fail("{}: expected chunks apart, found some that overlap", other.where(part));
      other.bytes().read(at, chunk.data(), chunk.size());
      at = file.append(chunk);
    }
  }

  void setMost(int samples) {
    eraseAttribute(parts[own].header, "maxSamplesPerPixel");
    parts[own].header.insert("maxSamplesPerPixel", Imf::IntAttribute(samples));
  }

  // Everything in front of the chunks.
  Bytes head() const {
    Bytes bytes;
    put(bytes, Imf::MAGIC);
    int version = Imf::EXR_VERSION | Imf::NON_IMAGE_FLAG | (parts.size() > 1 ? Imf::MULTI_PART_FILE_FLAG : 0);
    for (const Part& part : parts) version |= hasLongNames(part.header) ? Imf::LONG_NAMES_FLAG : 0;
    put(bytes, version);
    HeaderBytes stream(bytes);
    for (const Part& part : parts) part.header.writeTo(stream, Imf::isTiled(part.header.type()));
    if (parts.size() > 1) bytes.push_back(0);
    for (const Part& part : parts)
      for (uint64_t at : part.table) put(bytes, at);
    return bytes;
  }

  // Rows that wait for the rest of their tiles, then the new ones.
  using Sources = std::vector<const DeepImage*>;

  void write(const DeepImage& band) {
    check(band);
    Sources sources;
    for (const DeepImage& image : pending) sources.push_back(&image);
    sources.push_back(&band);
    nextRow = band.dataWindow.y1;
    const int done = nextRow - (nextRow == dataWindow.y1 ? 0 : (nextRow - dataWindow.y0) % tileRows);
    writeChunks(sources, done);
    std::erase_if(pending, [&](const DeepImage& image) { return image.dataWindow.y1 <= done; });
    if (done < nextRow) pending.push_back(rows(band, std::max(done, band.dataWindow.y0), nextRow));
  }

  void check(const DeepImage& band) const {
    const Box& w = band.dataWindow;
    if (w.x0 != dataWindow.x0 || w.x1 != dataWindow.x1 || w.y0 != nextRow || w.y1 > dataWindow.y1)
      fail("{}: expected rows from {} on, columns {} to {}; found rows from {} on, columns {} to {}", file.path(),
           nextRow, dataWindow.x0, dataWindow.x1, w.y0, w.x0, w.x1);
    for (const ChannelInfo& c : channels) {
      const Channel* channel = band.find(c.name);
      if (!channel || channel->type != c.type)
        fail("{}, channel {}: expected in every band as in the first", file.path(), c.name);
      if (channel->size() < band.samples())
        fail("{}, channel {}: expected {} values, found {}", file.path(), c.name, band.samples(), channel->size());
    }
  }

  void writeChunks(const Sources& sources, int done) {
    const int first = (writtenRows + tileRows - 1) / tileRows * columns;
    const int last = (done - dataWindow.y0 + tileRows - 1) / tileRows * columns;
    int next = first;
    const auto number = [&](tbb::flow_control& control) {
      if (next >= last) control.stop();
      return next++;
    };
    const auto pack = [&](int chunk) { return std::pair(chunk, packChunk(sources, chunk)); };
    const auto append = [&](const std::pair<int, Bytes>& chunk) {
      parts[own].table[size_t(chunk.first)] = file.append(chunk.second);
    };
    tbb::parallel_pipeline(
        2 * size_t(tbb::this_task_arena::max_concurrency()),
        tbb::make_filter<void, int>(tbb::filter_mode::serial_in_order, number) &
            tbb::make_filter<int, std::pair<int, Bytes>>(tbb::filter_mode::parallel, pack) &
            tbb::make_filter<std::pair<int, Bytes>, void>(tbb::filter_mode::serial_in_order, append));
    for (const Scratch& local : scratch) most = std::max(most, local.most);
    writtenRows = done - dataWindow.y0;
  }

  struct Scratch {
    Packer packer;
    Bytes counts, samples;
    uint32_t most = 0;
  };

  Bytes packChunk(const Sources& sources, int number) {
    const int tx = number % columns, ty = number / columns;
    Box box{dataWindow.x0, dataWindow.y0 + ty * tileRows, dataWindow.x1, dataWindow.y1};
    if (tiled) box.x0 += tx * options.tileWidth;
    if (tiled) box.x1 = int(std::min<int64_t>(box.x1, int64_t(box.x0) + options.tileWidth));
    box.y1 = int(std::min<int64_t>(box.y1, int64_t(box.y0) + tileRows));
    Scratch& local = scratch.local();
    local.counts.clear();
    local.samples.clear();
    for (const DeepImage* image : sources)
      for (int y = std::max(box.y0, image->dataWindow.y0); y < std::min(box.y1, image->dataWindow.y1); ++y)
        addRow(*image, box, y, local);

    Bytes bytes;
    if (parts.size() > 1) put(bytes, int32_t(own));
    if (tiled)
      for (int32_t place : {tx, ty, 0, 0}) put(bytes, place);
    else
      put(bytes, int32_t(box.y0));
    const size_t sizesAt = bytes.size();
    bytes.resize(sizesAt + 3 * sizeof(uint64_t));
    const size_t countsAt = bytes.size();
    const size_t fullTable = tiled ? 4 * size_t(options.tileWidth) * size_t(options.tileHeight) : local.counts.size();
    local.packer.pack(options.compression, local.counts, fullTable, bytes);
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
      fail("{}, row {}: expected at most {} samples, found {}", file.path(), y, INT32_MAX, last - first);
    const size_t n = size_t(last - first);
    auto* sums = reinterpret_cast<uint32_t*>(grow(local.counts, 4 * size_t(box.width())));
    for (int x = 0; x < box.width(); ++x) {
      sums[x] = uint32_t(offsets[x + 1] - first);
      local.most = std::max(local.most, uint32_t(offsets[x + 1] - offsets[x]));
    }
    for (const ChannelInfo& c : channels) {
      const Channel& channel = *image.find(c.name);
      uint8_t* to = grow(local.samples, n * (c.type == PixelType::Half ? 2 : 4));
      if (c.type == PixelType::Uint)
        std::memcpy(to, channel.ids.data() + first, 4 * n);
      else if (c.type == PixelType::Float)
        std::memcpy(to, channel.values.data() + first, 4 * n);
      else
        putHalf({channel.values.data() + first, n}, to);
    }
  }

  static void putHalf(std::span<const float> values, uint8_t* to) {
    for (size_t i = 0; i < values.size(); ++i) {
      const uint16_t bits = imath_float_to_half(values[i]);
      std::memcpy(to + 2 * i, &bits, sizeof(bits));
    }
  }

  void finish() {
    if (nextRow != dataWindow.y1)
      fail("{}: expected rows up to {}, found them up to {}", file.path(), dataWindow.y1, nextRow);
    setMost(int(most));
    file.overwrite(0, head());
    file.finish();
  }

  OutputFile file;
  WriteOptions options;
  Box dataWindow;
  int nextRow;
  int writtenRows = 0;
  bool tiled = false;
  int columns = 1, tileRows = 1;      // chunks side by side, and the rows of one
  std::vector<ChannelInfo> channels;  // as they stand in the file
  std::vector<Part> parts;
  size_t own = 0;  // the part that is written here
  uint32_t most = 0;
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
