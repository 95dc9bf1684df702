#include "cli/bands.h"

#include "flat/error.h"

namespace fathom::cli {

namespace {

constexpr double kBandBytes = double(size_t(256) << 20);

double decodedBytes(deep::Reader& reader, int y0, int y1) {
  double samples = 0;
  for (const uint32_t count : reader.sampleCounts(y0, y1)) samples += count;
  return 4 * samples * double(reader.part().channels.size());
}

// Where the band that starts at y0 ends.
int bandEnd(deep::Reader& reader, int y0) {
  const deep::PartInfo& part = reader.part();
  const int step = part.tiled ? part.tileHeight : 1, end = part.dataWindow.y1;
  double bytes = 0;
  int y = y0;
  while (y < end) {
    const int next = end - y > step ? y + step : end;
    bytes += decodedBytes(reader, y, next);
    if (y > y0 && bytes > kBandBytes) break;
    y = next;
  }
  return y;
}

}  // namespace

void forEachBand(const std::string& path, deep::Reader& reader, const std::function<void(deep::DeepImage band)>& body) {
  const int end = reader.part().dataWindow.y1;
  for (int y0 = reader.part().dataWindow.y0; y0 < end;) {
    const int y1 = bandEnd(reader, y0);
    deep::DeepImage band = reader.read(y0, y1);
    try {
      body(std::move(band));
    } catch (const Error& e) {
      fail("{}: {}", path, e.what());
    }
    y0 = y1;
  }
}

deep::DeepImage readLayout(deep::Reader& reader) {
  const int y0 = reader.part().dataWindow.y0;
  return reader.read(y0, y0);
}

deep::WriteOptions likeInput(const std::string& path, const deep::PartInfo& part) {
  deep::WriteOptions options;
  options.compression = part.compression;
  if (part.tiled) options.tileWidth = part.tileWidth, options.tileHeight = part.tileHeight;
  options.otherPartsOf = path;
  options.replacedPart = part.number;
  return options;
}

}  // namespace fathom::cli
