#include "deep/exr_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfTileDescription.h>
#include <OpenEXR/ImfVersion.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/error.h"
#include "deep/exr_header.h"

namespace fathom::deep {

InputFile::InputFile(const std::string& path) : path_(path) {
  fd_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // without waiting for the writer of a named pipe
  if (fd_ < 0) fail("{}: cannot open: {}", path, std::strerror(errno));
  struct stat status = {};
  if (::fstat(fd_, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(fd_);
    fail("{}: expected a file, found something else", path);
  }
  size_ = uint64_t(status.st_size);
}

InputFile::~InputFile() {
  ::close(fd_);
}

void InputFile::read(uint64_t offset, void* to, size_t size) const {
  if (offset > size_ || size > size_ - offset)
    fail("{}: damaged or truncated: expected {} bytes at {}, found a file of {} bytes", path_, size, offset, size_);
  for (char* p = static_cast<char*>(to); size > 0;) {
    const ssize_t n = ::pread(fd_, p, size, off_t(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail("{}: cannot read: {}", path_, std::strerror(errno));
    if (n == 0) fail("{}: became shorter while it was read", path_);
    p += n;
    offset += uint64_t(n);
    size -= size_t(n);
  }
}

namespace {

PixelType pixelType(Imf::PixelType type) {
  return type == Imf::UINT ? PixelType::Uint : type == Imf::HALF ? PixelType::Half : PixelType::Float;
}

Compression compressionOf(Imf::Compression compression) {
  switch (compression) {
    case Imf::NO_COMPRESSION:
      return Compression::None;
    case Imf::RLE_COMPRESSION:
      return Compression::Rle;
    case Imf::ZIPS_COMPRESSION:
      return Compression::Zips;
    case Imf::ZIP_COMPRESSION:
      return Compression::Zip;
    default:
      return Compression::Other;
  }
}

const char* compressionName(Imf::Compression compression) {
  constexpr const char* kNames[] = {"none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab"};
  return size_t(compression) < std::size(kNames) ? kNames[size_t(compression)] : "unknown";
}

Box toBox(const Imath::Box2i& b) {
  return {b.min.x, b.min.y, b.max.x + 1, b.max.y + 1};
}

PartInfo describe(const Imf::Header& header, int number) {
  PartInfo part;
  part.number = number;
  if (header.hasName()) part.name = header.name();
  part.deep = Imf::isDeepData(header.type());
  part.tiled = Imf::isTiled(header.type());
  if (part.tiled) {
    part.tileWidth = int(header.tileDescription().xSize);
    part.tileHeight = int(header.tileDescription().ySize);
  }
  part.compression = compressionOf(header.compression());
  part.compressionName = compressionName(header.compression());
  part.dataWindow = toBox(header.dataWindow());
  part.displayWindow = toBox(header.displayWindow());
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c)
    part.channels.push_back({c.name(), pixelType(c.channel().type)});
  part.attributes = Attributes(header);
  return part;
}

int linesPerChunk(const PartInfo& part) {
  if (part.deep) return 1;
  switch (part.attributes.header().compression()) {
    case Imf::ZIP_COMPRESSION:
    case Imf::PXR24_COMPRESSION:
      return 16;
    case Imf::PIZ_COMPRESSION:
    case Imf::B44_COMPRESSION:
    case Imf::B44A_COMPRESSION:
    case Imf::DWAA_COMPRESSION:
      return 32;
    case Imf::DWAB_COMPRESSION:
      return 256;
    default:
      return 1;
  }
}

uint64_t divideUp(uint64_t a, uint64_t b) {
  return (a + b - 1) / b;
}

// The tiles of each level along one axis.
std::vector<uint64_t> tilesPerLevel(int size, int tile, int levels, bool roundUp) {
  std::vector<uint64_t> result;
  for (int l = 0; l < levels; ++l) {
    const uint64_t half = roundUp ? divideUp(uint64_t(size), uint64_t(1) << l) : uint64_t(size) >> l;
    result.push_back(divideUp(std::max<uint64_t>(half, 1), uint64_t(tile)));
  }
  return result;
}

int levelCount(int size, bool roundUp) {
  int levels = 1;
  for (uint64_t s = uint64_t(size); s > 1; s = roundUp ? (s + 1) / 2 : s / 2) ++levels;
  return levels;
}

// At most 2^62 tiles in a level and 2^11 of those: a double tells well enough what no file can hold.
double countTiles(const PartInfo& part) {
  const Imf::TileDescription& tiles = part.attributes.header().tileDescription();
  const bool roundUp = tiles.roundingMode == Imf::ROUND_UP;
  const int w = part.dataWindow.width(), h = part.dataWindow.height();
  const bool one = tiles.mode == Imf::ONE_LEVEL, mip = tiles.mode == Imf::MIPMAP_LEVELS;
  const int xLevels = one ? 1 : levelCount(mip ? std::max(w, h) : w, roundUp);
  const int yLevels = one ? 1 : levelCount(mip ? std::max(w, h) : h, roundUp);
  const std::vector<uint64_t> x = tilesPerLevel(w, part.tileWidth, xLevels, roundUp);
  const std::vector<uint64_t> y = tilesPerLevel(h, part.tileHeight, yLevels, roundUp);
  double sum = 0;
  for (size_t j = 0; j < y.size(); ++j)
    for (size_t i = 0; i < x.size(); ++i)
      if (!mip || i == j) sum += double(x[i]) * double(y[j]);
  return sum;
}

// The type attribute of a single-part file of flat pixels may be missing or wrong; the version field is right.
void settleType(Imf::Header& header, int version, bool multiPart) {
  if (!multiPart && !Imf::isNonImage(version))
    header.setType(Imf::isTiled(version) ? Imf::TILEDIMAGE : Imf::SCANLINEIMAGE);
}

// Standard attributes of another type than theirs say nothing, and could not be set where the header is written again.
void dropMistyped(Imf::Header& header) {
  if (!header.findTypedAttribute<Imf::StringAttribute>("name")) eraseAttribute(header, "name");
  for (const char* name : {"version", "chunkCount", "maxSamplesPerPixel"})
    if (!header.findTypedAttribute<Imf::IntAttribute>(name)) eraseAttribute(header, name);
}

}  // namespace

ExrFile::ExrFile(const std::string& path) : file_(path) {
  try {
    readHeaders();
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    std::string what = printable(e.what());
    if (what.ends_with('.')) what.pop_back();
    fail("{}: header: {}", path, what);
  }
}

void ExrFile::readHeaders() {
  const std::string& path = file_.path();
  HeaderStream stream(file_);
  if (file_.size() < 8 || readInt(stream) != Imf::MAGIC) fail("{}: not an EXR file", path);
  int version = readInt(stream);
  if (Imf::getVersion(version) != Imf::EXR_VERSION || !Imf::supportsFlags(Imf::getFlags(version)))
    fail("{}: expected version {} of EXR, found version field {:#x}", path, Imf::EXR_VERSION, version);
  multiPart_ = Imf::isMultiPart(version);
  while (checkHeader(stream, file_)) {
    Imf::Header header;
    header.readFrom(stream, version);
    dropMistyped(header);
    settleType(header, version, multiPart_);
    if (!header.hasType()) fail("{}, part {}: attribute type: expected, found none", path, parts_.size());
    header.sanityCheck(Imf::isTiled(header.type()), multiPart_);
    parts_.push_back(describe(header, int(parts_.size())));
    if (!multiPart_) break;
  }
  if (parts_.empty()) fail("{}: expected a header, found none", path);
  tables_ = stream.tellg() + (multiPart_ ? 1 : 0);
}

std::string ExrFile::where(const PartInfo& part) const {
  if (!multiPart_) return file_.path();
  const std::string name = part.name.empty() ? "" : " (" + printable(part.name) + ")";
  return fmt::format("{}, part {}{}", file_.path(), part.number, name);
}

uint64_t ExrFile::chunkCount(const PartInfo& part) const {
  const Imf::Header& header = part.attributes.header();
  const bool known = Imf::isSupportedType(header.type());
  if (!known && !header.hasChunkCount())
    fail("{}: attribute chunkCount: expected in a part of type {}, found none", where(part), printable(header.type()));
  double count = 0;
  if (!known)
    count = header.chunkCount();
  else if (part.tiled)
    count = countTiles(part);
  else
    count = double(divideUp(uint64_t(part.dataWindow.height()), uint64_t(linesPerChunk(part))));
  if (count < 0 || count * 8 > double(file_.size()))
    fail("{}: expected a table of {:.0f} chunks, found a file of {} bytes", where(part), count, file_.size());
  return uint64_t(count);
}

std::vector<uint64_t> ExrFile::chunkTable(const PartInfo& part) const {
  uint64_t at = tables_;
  for (int i = 0; i < part.number; ++i) at += 8 * chunkCount(parts_[size_t(i)]);
  std::vector<uint64_t> result(chunkCount(part));
  file_.read(at, result.data(), 8 * result.size());
  return result;
}

}  // namespace fathom::deep
