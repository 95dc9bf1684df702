// Flat parts of files of many, tiled images, and what reading them may take.
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDeepFrameBuffer.h>
#include <OpenEXR/ImfDeepScanLineOutputPart.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfTiledOutputFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "flat/io.h"
#include "tests/reference/flat_read_error.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::flat {
namespace {

using reference::errorOf;
using ::testing::HasSubstr;

// A part of one channel, Y, all of one value, in a file of several.
Imf::Header partHeader(const char* name, const std::string& type, int width, int height) {
  const Imath::Box2i shown({0, 0}, {63, 63});
  Imf::Header header(shown, Imath::Box2i({0, 0}, {width - 1, height - 1}));
  header.compression() = Imf::ZIPS_COMPRESSION;
  header.setName(name);
  header.setType(type);
  header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
  return header;
}

void writeFlatPart(Imf::MultiPartOutputFile& file, int number, float value) {
  Imf::OutputPart part(file, number);
  std::vector<float> row(size_t(part.header().dataWindow().max.x) + 1, value);
  Imf::FrameBuffer frame;
  for (auto c = part.header().channels().begin(); c != part.header().channels().end(); ++c)
    frame.insert(c.name(), Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(row.data()), sizeof value, 0));
  part.setFrameBuffer(frame);
  part.writePixels(part.header().dataWindow().max.y + 1);
}

void writeEmptyDeepPart(Imf::MultiPartOutputFile& file, int number) {
  Imf::DeepScanLineOutputPart part(file, number);
  unsigned none = 0;
  char* nowhere = nullptr;
  Imf::DeepFrameBuffer frame;
  frame.insertSampleCountSlice(Imf::Slice(Imf::UINT, reinterpret_cast<char*>(&none), 0, 0));
  for (auto c = part.header().channels().begin(); c != part.header().channels().end(); ++c)
    frame.insert(c.name(), Imf::DeepSlice(Imf::FLOAT, reinterpret_cast<char*>(&nowhere), 0, 0, 4));
  part.setFrameBuffer(frame);
  part.writePixels(part.header().dataWindow().max.y + 1);
}

TEST(FlatIoParts, PartsByNumberByNameAndTheFirstFlatOne) {
  const TemporaryFolder folder;
  const std::string path = folder / "parts.exr";
  {
    const Imf::Header headers[] = {partHeader("volume", Imf::DEEPSCANLINE, 5, 4),
                                   partHeader("beauty", Imf::SCANLINEIMAGE, 5, 4),
                                   partHeader("depth", Imf::SCANLINEIMAGE, 5, 4)};
    Imf::MultiPartOutputFile file(path.c_str(), headers, 3);
    writeEmptyDeepPart(file, 0);
    writeFlatPart(file, 1, 1);
    writeFlatPart(file, 2, 2);
  }
  EXPECT_EQ(read(path).planes.at(0).values[7], 1);
  for (const char* part : {"1", "beauty"}) EXPECT_EQ(read(path, {.part = part}).planes.at(0).values[7], 1);
  for (const char* part : {"2", "depth"}) EXPECT_EQ(read(path, {.part = part}).planes.at(0).values[7], 2);
  for (const std::string part : {"0", "volume"})
    EXPECT_THAT(errorOf(path, {.part = part}),
                HasSubstr("parts.exr, part " + part + ": expected a flat image, found a deep one"));
  EXPECT_THAT(errorOf(path, {.part = "sky"}), HasSubstr("expected a part sky, found 3 part(s) without it"));
  {
    const Imf::Header headers[] = {partHeader("volume", Imf::DEEPSCANLINE, 5, 4)};
    Imf::MultiPartOutputFile file(path.c_str(), headers, 1);
    writeEmptyDeepPart(file, 0);
  }
  EXPECT_THAT(errorOf(path), HasSubstr("parts.exr: expected a flat image, found 1 deep part(s) only"));
}

// What a reader holds: a block of rows, 256 at most, or a tile; of deep parts, which are not read here, the counts alone.
TEST(FlatIoParts, PartsAreHeldToTheMemoryLimit) {
  const TemporaryFolder folder;
  const std::string path = folder / "parts.exr";
  const auto make = [&](const Imf::Header& first, const Imf::Header& second) {
    const Imf::Header headers[] = {first, second};
    Imf::MultiPartOutputFile file(path.c_str(), headers, 2);
    if (first.type() == Imf::DEEPSCANLINE)
      writeEmptyDeepPart(file, 0);
    else
      writeFlatPart(file, 0, 1);
    writeFlatPart(file, 1, 1);
  };
  Imf::Header deep = partHeader("volume", Imf::DEEPSCANLINE, 5, 4);
  for (char name = 'a'; name <= 't'; ++name) deep.channels().insert(std::string(1, name), Imf::Channel(Imf::FLOAT));
  make(deep, partHeader("beauty", Imf::SCANLINEIMAGE, 5, 4));
  EXPECT_EQ(errorOf(path, {.memoryLimit = 5 * 256 * 4}), "");
  EXPECT_THAT(errorOf(path, {.memoryLimit = 5 * 256 * 4 - 1}), HasSubstr("parts.exr, part 0: expected at most"));

  Imf::Header two = partHeader("two", Imf::SCANLINEIMAGE, 5, 300);
  two.channels().insert("A", Imf::Channel(Imf::FLOAT));
  make(partHeader("beauty", Imf::SCANLINEIMAGE, 5, 4), two);
  EXPECT_EQ(errorOf(path, {.memoryLimit = 5 * 300 * 4 * 2}), "");
  EXPECT_THAT(errorOf(path, {.memoryLimit = 5 * 300 * 4 * 2 - 1}), HasSubstr("parts.exr, part 1: expected at most"));
}

// A tiled image whose values tell their place.
void writeTiled(const std::string& path, const Box& window, int tileWidth, int tileHeight) {
  const Imath::Box2i pixels({window.x0, window.y0}, {window.x1 - 1, window.y1 - 1});
  Imf::Header header(pixels, pixels);
  header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
  header.setTileDescription(Imf::TileDescription(unsigned(tileWidth), unsigned(tileHeight)));
  std::vector<float> values(window.area());
  for (size_t i = 0; i < values.size(); ++i) values[i] = float(i);
  Imf::FrameBuffer frame;
  frame.insert("Y", Imf::Slice::Make(Imf::FLOAT, values.data(), pixels));
  Imf::TiledOutputFile file(path.c_str(), header);
  file.setFrameBuffer(frame);
  file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
}

TEST(FlatIoParts, TilesAreReadInTheirPlace) {
  const TemporaryFolder folder;
  const Box window = {-3, 5, 34, 105};
  for (const auto& [width, height] : {std::pair(16, 8), std::pair(10, 128), std::pair(64, 96)}) {
    writeTiled(folder / "tiles.exr", window, width, height);
    const Image image = read(folder / "tiles.exr");
    ASSERT_EQ(image.dataWindow, window);
    for (size_t i = 0; i < window.area(); ++i) ASSERT_EQ(image.planes[0].values[i], float(i)) << width;
  }
}

TEST(FlatIoParts, TilesAreHeldToTheMemoryLimit) {
  const TemporaryFolder folder;
  writeTiled(folder / "tiles.exr", {0, 0, 4, 4}, 64, 2048);
  EXPECT_EQ(errorOf(folder / "tiles.exr", {.memoryLimit = 64 * 2048 * 4}), "");
  EXPECT_THAT(errorOf(folder / "tiles.exr", {.memoryLimit = 64 * 2048 * 4 - 1}), HasSubstr("expected at most"));
}

}  // namespace
}  // namespace fathom::flat
