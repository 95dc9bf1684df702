// Files of many parts: the tables of all kinds of parts lead to the one behind them, and what is copied is looked at.
#include <OpenEXR/ImfDeepScanLineOutputPart.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfTiledOutputFile.h>
#include <OpenEXR/ImfTiledOutputPart.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <iterator>

#include "base/error.h"
#include "deep/exr_file.h"
#include "deep/io.h"
#include "tests/reference/openexr_deep.h"
#include "tests/reference/random_deep.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::deep {
namespace {

using reference::difference;
using reference::randomDeep;
using ::testing::HasSubstr;

constexpr Box kDisplay = {0, 0, 20, 10};  // that all parts share

Imf::Header headerOf(const Box& window, const char* name, const std::string& type) {
  const Imath::Box2i pixels({window.x0, window.y0}, {window.x1 - 1, window.y1 - 1});
  Imf::Header header(Imath::Box2i({0, 0}, {kDisplay.x1 - 1, kDisplay.y1 - 1}), pixels);
  header.setName(name);
  header.setType(type);
  return header;
}

Imf::Header flatHeader(const Box& window, const std::string& type) {
  Imf::Header header = headerOf(window, "flat", type);
  header.channels().insert("Y", Imf::Channel(Imf::HALF));
  return header;
}

// Every row the same.
Imf::FrameBuffer frameOf(std::vector<half>& row) {
  Imf::FrameBuffer frame;
  frame.insert("Y", Imf::Slice(Imf::HALF, reinterpret_cast<char*>(row.data() + 8), sizeof(half), 0));
  return frame;
}

template <class Part>
void writeLevels(Part& part, std::vector<half>& row) {
  part.setFrameBuffer(frameOf(row));
  for (int y = 0; y < part.numYLevels(); ++y)
    for (int x = 0; x < part.numXLevels(); ++x)
      if (part.isValidLevel(x, y)) part.writeTiles(0, part.numXTiles(x) - 1, 0, part.numYTiles(y) - 1, x, y);
}

class IoParts : public ::testing::Test {
 protected:
  // A file of this part and a deep one.
  void make(const Imf::Header& flat) {
    const Imf::Header headers[] = {flat, deepHeader("deep")};
    Imf::MultiPartOutputFile file(path_.c_str(), headers, 2);
    if (flat.type() == Imf::TILEDIMAGE) {
      Imf::TiledOutputPart part(file, 0);
      writeLevels(part, row_);
    } else {
      Imf::OutputPart part(file, 0);
      part.setFrameBuffer(frameOf(row_));
      part.writePixels(flat.dataWindow().max.y - flat.dataWindow().min.y + 1);
    }
    writeDeep(file, 1);
  }

  void makeTwoDeep() {
    const Imf::Header headers[] = {deepHeader("first"), deepHeader("second")};
    Imf::MultiPartOutputFile file(path_.c_str(), headers, 2);
    writeDeep(file, 0);
    writeDeep(file, 1);
  }

  Imf::Header deepHeader(const char* name) const {
    Imf::Header header = headerOf(deep_.dataWindow, name, Imf::DEEPSCANLINE);
    header.compression() = Imf::NO_COMPRESSION;
    for (const Channel& c : deep_.channels) header.channels().insert(c.name, Imf::Channel(Imf::FLOAT));
    return header;
  }

  void writeDeep(Imf::MultiPartOutputFile& file, int number) {
    Imf::DeepScanLineOutputPart part(file, number);
    reference::Pointers pointers;
    part.setFrameBuffer(reference::frameBuffer(deep_, pointers));
    part.writePixels(deep_.dataWindow.height());
  }

  std::string bytes() const {
    std::ifstream in(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }

  void change(const std::string& bytes) { std::ofstream(path_, std::ios::binary) << bytes; }

  template <class T>
  void change(size_t at, T value) {
    std::string all = bytes();
    std::memcpy(all.data() + at, &value, sizeof(value));
    change(all);
  }

  std::vector<uint64_t> tableOf(size_t part) const {
    const ExrFile file(path_);
    return file.chunkTable(file.parts()[part]);
  }

  // The error of writing the deep image in the place of a part.
  std::string errorOfReplacing(int part) {
    WriteOptions options;
    options.otherPartsOf = path_;
    options.replacedPart = part;
    try {
      write(folder_ / "out.exr", deep_, options);
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  }

  TemporaryFolder folder_;
  std::string path_ = folder_ / "a.exr";
  std::vector<half> row_ = std::vector<half>(64, 0.5f);  // from column -8 on
  DeepImage deep_ = randomDeep({0, 0, 5, 4}, kDisplay, {{"A", PixelType::Float}, {"Z", PixelType::Float}});
};

constexpr std::pair<Imf::Compression, const char*> kCompressions[] = {
    {Imf::NO_COMPRESSION, "none"},  {Imf::RLE_COMPRESSION, "rle"},   {Imf::ZIPS_COMPRESSION, "zips"},
    {Imf::ZIP_COMPRESSION, "zip"},  {Imf::PIZ_COMPRESSION, "piz"},   {Imf::PXR24_COMPRESSION, "pxr24"},
    {Imf::B44_COMPRESSION, "b44"},  {Imf::B44A_COMPRESSION, "b44a"}, {Imf::DWAA_COMPRESSION, "dwaa"},
    {Imf::DWAB_COMPRESSION, "dwab"}};

TEST_F(IoParts, BehindRowsOfEveryCompressionAreFound) {
  for (const auto& [compression, name] : kCompressions) {
    SCOPED_TRACE(name);
    Imf::Header header = flatHeader({0, 0, 3, 600}, Imf::SCANLINEIMAGE);
    header.compression() = compression;
    make(header);
    EXPECT_EQ(difference(deep_, read(path_)), "");
    EXPECT_EQ(readParts(path_)[0].compressionName, name);
  }
}

TEST_F(IoParts, BehindTilesOfEveryKindAreFound) {
  for (const Box& window : {Box{-1, 2, 36, 25}, Box{0, 0, 23, 37}})
    for (const auto mode : {Imf::ONE_LEVEL, Imf::MIPMAP_LEVELS, Imf::RIPMAP_LEVELS})
      for (const auto rounding : {Imf::ROUND_DOWN, Imf::ROUND_UP}) {
        SCOPED_TRACE(fmt::format("{} wide, mode {}, rounding {}", window.width(), int(mode), int(rounding)));
        Imf::Header header = flatHeader(window, Imf::TILEDIMAGE);
        header.setTileDescription(Imf::TileDescription(4, 2, mode, rounding));
        make(header);
        EXPECT_EQ(difference(deep_, read(path_)), "");
      }
}

// How many chunks a part of a later version of EXR has, only its header tells.
TEST_F(IoParts, BehindPartsOfAnUnknownTypeAreFoundButNotCopied) {
  Imf::Header header = flatHeader({0, 0, 30, 30}, Imf::TILEDIMAGE);
  header.setTileDescription(Imf::TileDescription(4, 4));
  make(header);
  std::string all = bytes();
  all.replace(all.find("tiledimage"), 10, "tiledimagX");
  change(all);
  EXPECT_EQ(difference(deep_, read(path_)), "");
  EXPECT_EQ(tableOf(0).size(), 64u);
  EXPECT_THAT(errorOfReplacing(1), HasSubstr("a.exr, part 0 (flat): cannot copy a part of type tiledimagX"));
  all.replace(all.find("chunkCount"), 10, "chunkCounX");
  change(all);
  try {
    read(path_);
    FAIL();
  } catch (const Error& e) {
    EXPECT_THAT(e.what(),
                HasSubstr("a.exr, part 0 (flat): attribute chunkCount: expected in a part of type tiledimagX"));
  }
}

TEST_F(IoParts, FlatFilesOfOnePartNeedNoType) {
  Imf::Header header(20, 30);
  header.channels().insert("Y", Imf::Channel(Imf::HALF));
  header.setTileDescription(Imf::TileDescription(8, 16));
  {
    Imf::TiledOutputFile file(path_.c_str(), header);
    writeLevels(file, row_);
  }
  std::string all = bytes();
  if (const size_t at = all.find(std::string("type\0string", 11)); at != std::string::npos)
    change(all.replace(at, 4, "tipe"));
  const PartInfo part = readParts(path_).at(0);
  EXPECT_TRUE(part.tiled);
  EXPECT_FALSE(part.deep);
  EXPECT_EQ(part.tileWidth, 8);
  EXPECT_EQ(part.tileHeight, 16);
}

TEST_F(IoParts, OfManyNeedATypeEach) {
  makeTwoDeep();
  std::string all = bytes();
  const size_t second = all.find("type", all.find("type") + 4);
  change(all.replace(all.find(std::string("type\0string", 11), second - 4), 4, "tipe"));
  try {
    readParts(path_);
    FAIL();
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("a.exr, part 1: attribute type: expected, found none"));
  }
}

TEST_F(IoParts, ThatAreNotThereCannotBeReplaced) {
  makeTwoDeep();
  EXPECT_THAT(errorOfReplacing(2), HasSubstr("a.exr: expected part 2, found 2 parts"));
  EXPECT_THAT(errorOfReplacing(-1), HasSubstr("a.exr: expected part -1, found 2 parts"));
  EXPECT_EQ(errorOfReplacing(1), "no error");
}

TEST_F(IoParts, ThatAreDamagedAreNotCopied) {
  makeTwoDeep();
  const std::string whole = bytes();
  const uint64_t chunk = tableOf(1)[2], table = tableOf(0)[0] - 8 * 4;
  // A part number, a row, then the sizes.
  change(chunk + 8, ~uint64_t(0));
  EXPECT_THAT(errorOfReplacing(0), HasSubstr("part 1 (second): expected 18446744073709551615 and"));
  change(whole);
  change(chunk + 16, ~uint64_t(0) - 100);
  EXPECT_THAT(errorOfReplacing(0), HasSubstr("part 1 (second): expected 20 and 18446744073709551515 bytes in a chunk"));
  change(whole);
  change(table + 16, uint64_t(0));
  EXPECT_THAT(errorOfReplacing(0), HasSubstr("part 1 (second): cannot copy: the part was not finished"));
  EXPECT_EQ(errorOfReplacing(1), "no error");
}

// A header of one part may hold anything under that name.
TEST_F(IoParts, NamesOfAnotherTypeAreNoHindranceToReplacing) {
  DeepImage named = deep_.copy();
  named.attributes.set("name", std::string("alone"));
  write(path_, named);
  std::string all = bytes();
  change(all.replace(all.find(std::string("name\0string", 11)) + 5, 6, "strinj"));
  const DeepImage image = read(path_);
  makeTwoDeep();
  WriteOptions options;
  options.otherPartsOf = path_;
  options.replacedPart = 1;
  write(folder_ / "out.exr", image, options);
  EXPECT_EQ(readParts(folder_ / "out.exr")[1].name, "second");
}

// A table that leads to the same chunk over and over would make a file of any length.
TEST_F(IoParts, WhoseChunksOverlapAreNotCopied) {
  const Box box = {0, 0, 1, 20};
  deep_ = {box, kDisplay, Buffer<uint64_t>(21, 1000), {}, {}};  // all in the first row
  deep_.offsets[0] = 0;
  for (const char* name : {"A", "Z"}) deep_.add(name, PixelType::Float).values.fill(1);
  makeTwoDeep();
  const uint64_t longest = tableOf(1)[0], table = tableOf(0)[0] - 8 * 20;
  for (size_t i = 0; i < 20; ++i) change(table + 8 * i, longest);
  EXPECT_THAT(errorOfReplacing(0), HasSubstr("part 1 (second): expected chunks apart, found some that overlap"));
}

}  // namespace
}  // namespace fathom::deep
