#include "flat/exr_writer.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfVersion.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <set>
#include <vector>

#include "base/error.h"
#include "flat/attribute_text.h"
#include "flat/exr_attributes.h"
#include "flat/exr_bytes.h"
#include "flat/exr_codec.h"
#include "flat/output_file.h"
#include "flat/parallel_in_order.h"

namespace fathom::flat {

namespace {

constexpr int kBlockRows = 16;  // of a ZIP chunk

// What describes the encoding of the file that an attribute came from.
bool describesEncoding(const std::string& name) {
  static const std::set<std::string> own = {"compression", "chunkCount", "name",     "type",       "version",
                                            "tiles",       "lineOrder",  "channels", "dataWindow", "displayWindow"};
  return own.contains(name) || name.starts_with("oiio:") || name.starts_with("openexr:");
}

// Ids and coverages of a Cryptomatte layer, NAME00.R and so on: ids are bits of a float.
bool isCryptomatte(const Image& image, std::string_view name) {
  return std::ranges::any_of(image.attributes, [&](const auto& attribute) {
    if (!attribute.first.starts_with("cryptomatte/") || !attribute.first.ends_with("/name")) return false;
    const AttributeValue value = parseAttribute(attribute.second);
    const auto* layer = std::get_if<std::string>(&value);
    return layer && name.starts_with(*layer);
  });
}

bool needsRange(const Image& image, std::string_view name) {
  return name == "Z" || name.starts_with("Z.") || name == "ZBack" || name.ends_with("samples") ||
         name.find("variance") != name.npos || isCryptomatte(image, name);
}

Imath::Box2i inclusive(const Box& box) {
  return {{box.x0, box.y0}, {box.x1 - 1, box.y1 - 1}};
}

}  // namespace

struct ExrWriter::Impl {
  // A plane as the file has it.
  struct Stored {
    size_t plane;
    PixelType type;
  };
  struct Scratch {
    Packer packer;
    Bytes raw;
  };

  Impl(const std::string& path, const Image& layout, const Box& dataWindow, const WriteOptions& options)
      : window(dataWindow), nextRow(dataWindow.y0), header(headerOf(path, layout, dataWindow)), file(path) {
    std::set<std::pair<std::string, size_t>> byName;
    for (size_t i = 0; i < layout.planes.size(); ++i) byName.insert({layout.planes[i].name, i});
    for (const auto& [name, plane] : byName) {
      stored.push_back({plane, options.half && !needsRange(layout, name) ? PixelType::Half : PixelType::Float});
      header.channels().insert(name, Imf::Channel(stored.back().type == PixelType::Half ? Imf::HALF : Imf::FLOAT));
      rowBytes += size_t(dataWindow.width()) * valueBytes(stored.back().type);
    }
    if (rowBytes * kBlockRows > size_t(INT32_MAX))
      fail("{}: expected rows of at most {} bytes, found {}", path, INT32_MAX / kBlockRows, rowBytes);
    table.resize(size_t((dataWindow.height() + kBlockRows - 1) / kBlockRows));
    file.append(head());
  }

  static Imf::Header headerOf(const std::string& path, const Image& layout, const Box& dataWindow) {
    if (dataWindow.empty() || layout.planes.empty()) fail("{}: expected an image to write, found an empty one", path);
    std::set<std::string> names;
    for (const Plane& plane : layout.planes)
      if (!names.insert(plane.name).second)
        fail("{}, channel {}: expected once, found twice", path, printable(plane.name));
    Imf::Header result(inclusive(layout.displayWindow), inclusive(dataWindow));
    std::map<std::string, std::string> kept = layout.attributes;
    std::erase_if(kept, [](const auto& attribute) { return describesEncoding(attribute.first); });
    addAttributes(kept, result);
    result.compression() = Imf::ZIP_COMPRESSION;
    return result;
  }

  Bytes head() const {
    Bytes bytes;
    put(bytes, Imf::MAGIC);
    put(bytes, Imf::EXR_VERSION | (hasLongNames(header) ? Imf::LONG_NAMES_FLAG : 0));
    putHeader(bytes, header, false);
    for (const uint64_t at : table) put(bytes, at);
    return bytes;
  }

  void write(const Image& rows) {
    const Box& box = rows.dataWindow;
    if (box.x0 != window.x0 || box.x1 != window.x1 || box.y0 != nextRow || box.y1 > window.y1 ||
        rows.planes.size() != stored.size())
      fail(
          "{}: expected {} planes and rows from {} on, columns {} to {}; found {} planes and rows from {} on, columns "
          "{} to {}",
          file.path(), stored.size(), nextRow, window.x0, window.x1, rows.planes.size(), box.y0, box.x0, box.x1);
    if (box.empty()) return;
    nextRow = box.y1;
    const size_t first = nextBlock;
    const size_t last = nextRow == window.y1 ? table.size() : size_t((nextRow - window.y0) / kBlockRows);
    parallelInOrder(
        first, last, [&](size_t block) { return pack(rows, block); },
        [&](size_t block, const Bytes& bytes) { table[block] = file.append(bytes); });
    nextBlock = last;
    if (last > first) waiting.clear();
    for (int y = std::max(box.y0, window.y0 + int(last) * kBlockRows); y < box.y1; ++y) addRow(rows, y, waiting);
  }

  // The chunk of a block: the rows of it that waited, then the new ones.
  Bytes pack(const Image& rows, size_t block) {
    Scratch& local = scratch.local();
    local.raw.clear();
    const int y0 = window.y0 + int(block) * kBlockRows, y1 = std::min(y0 + kBlockRows, window.y1);
    if (y0 < rows.dataWindow.y0) local.raw = waiting;
    for (int y = std::max(y0, rows.dataWindow.y0); y < y1; ++y) addRow(rows, y, local.raw);
    Bytes bytes;
    put(bytes, int32_t(y0));
    put(bytes, int32_t(0));
    local.packer.pack(Compression::Zip, local.raw, local.raw.size(), bytes);
    const auto size = int32_t(bytes.size() - 8);
    std::memcpy(bytes.data() + 4, &size, sizeof(size));
    return bytes;
  }

  void addRow(const Image& rows, int y, Bytes& to) const {
    for (const Stored& channel : stored) {
      const size_t width = size_t(window.width());
      const std::span<const float> values = rows.planes[channel.plane].row(window.width(), y - rows.dataWindow.y0);
      uint8_t* at = grow(to, width * valueBytes(channel.type));
      if (channel.type == PixelType::Half)
        putHalf(values, at);
      else
        std::memcpy(at, values.data(), values.size_bytes());
    }
  }

  Box window;
  int nextRow;
  size_t nextBlock = 0;
  size_t rowBytes = 0;
  Imf::Header header;
  std::vector<Stored> stored;  // as the file has them: by name
  std::vector<uint64_t> table;
  Bytes waiting;  // rows of a block that is not complete
  tbb::enumerable_thread_specific<Scratch> scratch;
  OutputFile file;
};

ExrWriter::ExrWriter(const std::string& path, const Image& layout, const Box& dataWindow, const WriteOptions& options)
    : impl_(std::make_unique<Impl>(path, layout, dataWindow, options)) {}
ExrWriter::ExrWriter(ExrWriter&&) noexcept = default;
ExrWriter::~ExrWriter() = default;

void ExrWriter::write(const Image& rows) {
  impl_->write(rows);
}

void ExrWriter::finish() {
  if (impl_->nextRow != impl_->window.y1)
    fail("{}: expected rows up to {}, found them up to {}", impl_->file.path(), impl_->window.y1, impl_->nextRow);
  impl_->file.overwrite(0, impl_->head());
  impl_->file.finish();
}

}  // namespace fathom::flat
