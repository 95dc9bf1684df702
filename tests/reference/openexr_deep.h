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

#include "deep/io.h"

namespace fathom::reference {

// Where the samples of each pixel lie, for a frame buffer.
struct Pointers {
  std::vector<unsigned> counts;
  std::vector<std::vector<char*>> channels;
};

// Planes are of FLOAT and UINT. On reading, OpenEXR makes floats of HALF channels; it does not write them so.
inline Imf::PixelType planeType(deep::PixelType type) {
  return type == deep::PixelType::Uint ? Imf::UINT : Imf::FLOAT;
}

// A frame buffer for channels of these names and types; `pointers` may be filled in later.
inline Imf::DeepFrameBuffer frameBuffer(const Box& window, const std::vector<deep::ChannelInfo>& channels,
                                        Pointers& pointers) {
  const size_t width = size_t(window.width());
  const ptrdiff_t origin = ptrdiff_t(window.x0) + ptrdiff_t(window.y0) * ptrdiff_t(width);
  Imf::DeepFrameBuffer buffer;
  pointers.counts.resize(window.area());
  buffer.insertSampleCountSlice(Imf::Slice(Imf::UINT, reinterpret_cast<char*>(pointers.counts.data() - origin),
                                           sizeof(unsigned), sizeof(unsigned) * width));
  pointers.channels.reserve(channels.size());
  for (const deep::ChannelInfo& c : channels) {
    auto& list = pointers.channels.emplace_back(window.area());
    buffer.insert(c.name, Imf::DeepSlice(planeType(c.type), reinterpret_cast<char*>(list.data() - origin),
                                         sizeof(char*), sizeof(char*) * width, 4));
  }
  return buffer;
}

// Points into the planes of an image that has those channels in that order.
inline void fillPointers(deep::DeepImage& image, Pointers& pointers) {
  for (size_t i = 0; i < image.channels.size(); ++i) {
    deep::Channel& c = image.channels[i];
    char* plane = c.type == deep::PixelType::Uint ? reinterpret_cast<char*>(c.ids.data())
                                                  : reinterpret_cast<char*>(c.values.data());
    for (size_t pixel = 0; pixel < image.pixels(); ++pixel)
      pointers.channels[i][pixel] = plane + 4 * image.offsets[pixel];
  }
}

// The same for an image that is to be written.
inline Imf::DeepFrameBuffer frameBuffer(deep::DeepImage& image, Pointers& pointers) {
  std::vector<deep::ChannelInfo> channels;
  for (const deep::Channel& c : image.channels) channels.push_back({c.name, c.type});
  Imf::DeepFrameBuffer buffer = frameBuffer(image.dataWindow, channels, pointers);
  for (size_t i = 0; i < image.pixels(); ++i) pointers.counts[i] = unsigned(image.count(i));
  fillPointers(image, pointers);
  return buffer;
}

// Null asks for all.
using ChannelFilter = bool (*)(const std::string&);

inline std::vector<deep::ChannelInfo> wantedChannels(const Imf::Header& header, ChannelFilter wanted) {
  std::vector<deep::ChannelInfo> result;
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
    const Imf::PixelType type = c.channel().type;
    if (!wanted || wanted(c.name()))
      result.push_back({c.name(), type == Imf::UINT   ? deep::PixelType::Uint
                                  : type == Imf::HALF ? deep::PixelType::Half
                                                      : deep::PixelType::Float});
  }
  return result;
}

inline Box boxOf(const Imath::Box2i& b) {
  return {b.min.x, b.min.y, b.max.x + 1, b.max.y + 1};
}

template <class Part, class ReadCounts, class ReadPixels>
deep::DeepImage readPart(Part& part, ChannelFilter wanted, const ReadCounts& readCounts, const ReadPixels& readPixels) {
  const std::vector<deep::ChannelInfo> channels = wantedChannels(part.header(), wanted);
  deep::DeepImage image;
  image.dataWindow = boxOf(part.header().dataWindow());
  image.displayWindow = boxOf(part.header().displayWindow());
  Pointers pointers;
  part.setFrameBuffer(frameBuffer(image.dataWindow, channels, pointers));
  readCounts();
  image.offsets = Buffer<uint64_t>(image.pixels() + 1);
  image.offsets[0] = 0;
  for (size_t i = 0; i < image.pixels(); ++i) image.offsets[i + 1] = image.offsets[i] + pointers.counts[i];
  for (const deep::ChannelInfo& c : channels) image.add(c.name, c.type);
  fillPointers(image, pointers);
  readPixels();
  return image;
}

inline deep::DeepImage readWithOpenExr(const std::string& path, int number = 0, ChannelFilter wanted = nullptr) {
  Imf::MultiPartInputFile file(path.c_str());
  if (Imf::isTiled(file.header(number).type())) {
    Imf::DeepTiledInputPart part(file, number);
    const int x = part.numXTiles(0) - 1, y = part.numYTiles(0) - 1;
    return readPart(
        part, wanted, [&] { part.readPixelSampleCounts(0, x, 0, y, 0); }, [&] { part.readTiles(0, x, 0, y, 0); });
  }
  Imf::DeepScanLineInputPart part(file, number);
  const Imath::Box2i w = part.header().dataWindow();
  return readPart(
      part, wanted, [&] { part.readPixelSampleCounts(w.min.y, w.max.y); }, [&] { part.readPixels(w.min.y, w.max.y); });
}

}  // namespace fathom::reference
