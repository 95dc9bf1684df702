// Deep EXR files through OpenEXR's own reader and writer: what ours is compared with.
#pragma once

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDeepFrameBuffer.h>
#include <OpenEXR/ImfDeepScanLineInputPart.h>
#include <OpenEXR/ImfDeepTiledInputPart.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfTileDescription.h>

#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::reference {

// Where the samples of each pixel lie, for a frame buffer.
struct Pointers {
  std::vector<unsigned> counts;
  std::vector<std::vector<char*>> channels;
};

inline Imf::PixelType imfType(deep::PixelType type) {
  return type == deep::PixelType::Uint ? Imf::UINT : Imf::FLOAT;
}

// A frame buffer on the image's planes. On reading OpenEXR makes floats of HALF channels; it does not write them so.
inline Imf::DeepFrameBuffer frameBuffer(deep::DeepImage& image, Pointers& pointers) {
  const Box& w = image.dataWindow;
  const size_t width = size_t(w.width());
  const ptrdiff_t origin = ptrdiff_t(w.x0) + ptrdiff_t(w.y0) * ptrdiff_t(width);
  Imf::DeepFrameBuffer buffer;
  buffer.insertSampleCountSlice(Imf::Slice(Imf::UINT, reinterpret_cast<char*>(pointers.counts.data() - origin),
                                           sizeof(unsigned), sizeof(unsigned) * width));
  pointers.channels.clear();
  pointers.channels.reserve(image.channels.size());
  for (deep::Channel& c : image.channels) {
    auto& list = pointers.channels.emplace_back(image.pixels());
    char* plane = c.type == deep::PixelType::Uint ? reinterpret_cast<char*>(c.ids.data())
                                                  : reinterpret_cast<char*>(c.values.data());
    for (size_t i = 0; i < list.size(); ++i) list[i] = plane + 4 * image.offsets[i];
    buffer.insert(c.name, Imf::DeepSlice(imfType(c.type), reinterpret_cast<char*>(list.data() - origin), sizeof(char*),
                                         sizeof(char*) * width, 4));
  }
  return buffer;
}

template <class Part, class ReadCounts, class ReadPixels>
deep::DeepImage readPart(Part& part, const ReadCounts& readCounts, const ReadPixels& readPixels) {
  const Imf::Header& header = part.header();
  const Imath::Box2i data = header.dataWindow(), display = header.displayWindow();
  deep::DeepImage image;
  image.dataWindow = {data.min.x, data.min.y, data.max.x + 1, data.max.y + 1};
  image.displayWindow = {display.min.x, display.min.y, display.max.x + 1, display.max.y + 1};
  Pointers pointers{std::vector<unsigned>(image.pixels()), {}};
  part.setFrameBuffer(frameBuffer(image, pointers));
  readCounts(part, image.dataWindow);
  image.offsets = Buffer<uint64_t>(image.pixels() + 1);
  image.offsets[0] = 0;
  for (size_t i = 0; i < image.pixels(); ++i) image.offsets[i + 1] = image.offsets[i] + pointers.counts[i];
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
    const Imf::PixelType type = c.channel().type;
    image.add(c.name(), type == Imf::UINT   ? deep::PixelType::Uint
                        : type == Imf::HALF ? deep::PixelType::Half
                                            : deep::PixelType::Float);
  }
  part.setFrameBuffer(frameBuffer(image, pointers));
  readCounts(part, image.dataWindow);
  readPixels(part, image.dataWindow);
  return image;
}

inline deep::DeepImage readWithOpenExr(const std::string& path, int number = 0) {
  Imf::MultiPartInputFile file(path.c_str());
  if (Imf::isTiled(file.header(number).type())) {
    Imf::DeepTiledInputPart part(file, number);
    const int x = part.numXTiles(0) - 1, y = part.numYTiles(0) - 1;
    return readPart(
        part, [&](auto& p, const Box&) { p.readPixelSampleCounts(0, x, 0, y, 0); },
        [&](auto& p, const Box&) { p.readTiles(0, x, 0, y, 0); });
  }
  Imf::DeepScanLineInputPart part(file, number);
  return readPart(
      part, [](auto& p, const Box& w) { p.readPixelSampleCounts(w.y0, w.y1 - 1); },
      [](auto& p, const Box& w) { p.readPixels(w.y0, w.y1 - 1); });
}

}  // namespace fathom::reference
