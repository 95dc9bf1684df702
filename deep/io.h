// Deep EXR files in and out, on OpenEXR's C++ library: deep scanlines and deep tiles (level 0), single and multi-part.
//
// Errors (fathom::Error) name the file, the part, the channel, what was expected and what was found. Any bytes as input
// end in an image or an Error; memory is checked against the limit before anything is allocated.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::deep {

using fathom::Compression;

struct ChannelInfo {
  std::string name;
  PixelType type;
};

struct PartInfo {
  int number = 0;
  std::string name;  // empty in single-part files
  bool deep = false;
  bool tiled = false;
  int tileWidth = 0, tileHeight = 0;
  Compression compression = Compression::Zips;
  std::string compressionName;
  Box dataWindow;
  Box displayWindow;
  std::vector<ChannelInfo> channels;
  Attributes attributes;
};

// The parts of an EXR file, deep or flat, from the headers alone.
std::vector<PartInfo> readParts(const std::string& path);

// Which channels of a file a caller needs: null asks for all.
using ChannelFilter = std::function<bool(const std::string& name)>;

struct ReadOptions {
  std::string part;                      // number or name; empty: the first deep part
  ChannelFilter channels;                // only these are unpacked
  size_t memoryLimit = size_t(8) << 30;  // bytes that one decoded image or band may take
};

// An open deep part. Rows decode in parallel; bands may be read in any order. Not for use from two threads at once.
class Reader {
 public:
  explicit Reader(const std::string& path, ReadOptions options = {});
  Reader(Reader&&) noexcept;
  ~Reader();

  const PartInfo& part() const;
  // The number of samples of each pixel of rows [y0, y1).
  Buffer<uint32_t> sampleCounts(int y0, int y1);
  // Where a band ends that begins at y0 and takes at most `bytes` decoded; it holds whole tiles, at least one row of
  // them.
  int bandEnd(int y0, size_t bytes);
  // Rows [y0, y1) of the data window, as an image whose data window is that band.
  DeepImage read(int y0, int y1);
  DeepImage read();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

DeepImage read(const std::string& path, const ReadOptions& options = {});

struct WriteOptions {
  Compression compression = Compression::Zips;
  int tileWidth = 0, tileHeight = 0;  // both > 0: deep tiles, else deep scanlines
  // The file and part number that the image came from: its other parts are copied verbatim, in their order.
  std::string otherPartsOf = {};
  int replacedPart = 0;
};

// Writes rows in order, in bands; the file stands at `path` only after finish(). Until then it is `path` + a temporary
// suffix in the same folder, which the destructor removes.
class Writer {
 public:
  // `layout` gives windows, attributes, channel names and types (its samples are not read).
  Writer(const std::string& path, const DeepImage& layout, const Box& dataWindow, const WriteOptions& options = {});
  Writer(Writer&&) noexcept;
  ~Writer();

  // The next rows below those already written; the band's channels as in the layout, in any order.
  void write(const DeepImage& band);
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

void write(const std::string& path, const DeepImage& image, const WriteOptions& options = {});

}  // namespace fathom::deep
