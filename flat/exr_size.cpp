#include "flat/exr_size.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfTileDescription.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "base/error.h"

namespace fathom::flat {

namespace {

// Readers hold whole blocks of rows, OpenImageIO that many at least, however few the image has.
constexpr double kRowsPerBlock = 256;

// What a reader of one part holds at least. In doubles, since windows may span all integers.
double decodedBytes(const Imf::Header& header) {
  const Imath::Box2i& window = header.dataWindow();
  double width = double(window.max.x) - window.min.x + 1;
  double height = std::max(double(window.max.y) - window.min.y + 1, kRowsPerBlock);
  if (header.hasTileDescription()) {
    width = std::max(width, double(header.tileDescription().xSize));
    height = std::max(height, double(header.tileDescription().ySize));
  }
  double channels = 0;
  for (auto it = header.channels().begin(); it != header.channels().end(); ++it) channels += 1;
  // Of a deep part, which is not decoded here, that is the sample counts.
  const bool deep = header.hasType() && Imf::isDeepData(header.type());
  return width * height * double(sizeof(float)) * (deep ? 1 : channels);
}

}  // namespace

bool isExr(const std::string& path) {
  std::error_code unknown;
  if (std::filesystem::exists(path, unknown) && !std::filesystem::is_regular_file(path, unknown))
    fail("{}: expected a file, found something else", path);
  std::ifstream file(path, std::ios::binary);
  if (!file) fail("{}: expected a readable file, found: {}", path, std::strerror(errno));
  char magic[4] = {};
  file.read(magic, sizeof magic);
  return std::string_view(magic, sizeof magic) == "\x76\x2f\x31\x01";
}

void checkExrSize(const std::string& path, size_t limit) {
  try {
    const Imf::MultiPartInputFile file(path.c_str(), 1, false);
    for (int part = 0; part < file.parts(); ++part) {
      const double bytes = decodedBytes(file.header(part));
      if (bytes > double(limit))
        fail("{}, part {}: expected at most {:.0f} MB of pixels, found a header that promises {:.0f} MB", path, part,
             double(limit) / 1e6, bytes / 1e6);
    }
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    fail("{}: expected an OpenEXR file, found a broken one: {}", path, oneLine(e.what()));
  }
}

}  // namespace fathom::flat
