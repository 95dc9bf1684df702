#include "cli/bands.h"

namespace fathom::cli {

void forEachBand(deep::Reader& reader, const std::function<void(deep::DeepImage band)>& body, size_t bandBytes) {
  const Box& window = reader.part().dataWindow;
  for (int y = window.y0; y < window.y1;) {
    const int end = reader.bandEnd(y, bandBytes);
    body(reader.read(y, end));
    y = end;
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
