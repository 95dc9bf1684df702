// Deep files: what is written comes back, through Fathom and through OpenEXR's own reader, whole and in pieces.
#include "deep/io.h"

#include <OpenEXR/ImfDeepScanLineOutputPart.h>
#include <OpenEXR/ImfDeepTiledOutputPart.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOpaqueAttribute.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringVectorAttribute.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <tbb/global_control.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "base/error.h"
#include "tests/reference/error_of.h"
#include "tests/reference/openexr_deep.h"
#include "tests/reference/random_deep.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::deep {
namespace {

using reference::difference;
using reference::errorOf;
using reference::randomDeep;
using reference::readWithOpenExr;
using ::testing::HasSubstr;

const std::vector<reference::NamedType> kAllTypes = {
    {"A", PixelType::Half}, {"Z", PixelType::Float}, {"id", PixelType::Uint}, {"variance.R", PixelType::Float}};

DeepImage sample(unsigned seed = 1) {
  return randomDeep({-7, 5, 30, 28}, {0, 0, 64, 48}, kAllTypes, seed);
}

std::string bytesOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

struct Layout {
  Compression compression;
  int tileWidth, tileHeight;
};

class EveryLayout : public ::testing::TestWithParam<Layout> {
 protected:
  WriteOptions options() const {
    WriteOptions result;
    result.compression = GetParam().compression;
    result.tileWidth = GetParam().tileWidth;
    result.tileHeight = GetParam().tileHeight;
    return result;
  }
  TemporaryFolder folder_;
};

std::string nameOf(const ::testing::TestParamInfo<Layout>& test) {
  const char* compression = std::array{"None", "Rle", "Zips"}[size_t(test.param.compression)];
  return fmt::format("{}{}x{}", compression, test.param.tileWidth, test.param.tileHeight);
}

INSTANTIATE_TEST_SUITE_P(Io, EveryLayout,
                         ::testing::Values(Layout{Compression::None, 0, 0}, Layout{Compression::Rle, 0, 0},
                                           Layout{Compression::Zips, 0, 0}, Layout{Compression::None, 16, 16},
                                           Layout{Compression::Rle, 5, 40}, Layout{Compression::Zips, 13, 7},
                                           Layout{Compression::Zips, 100, 100}, Layout{Compression::Zips, 1, 1}),
                         nameOf);

TEST_P(EveryLayout, ComesBackBitForBit) {
  const DeepImage image = sample();
  write(folder_ / "a.exr", image, options());
  EXPECT_EQ(difference(image, read(folder_ / "a.exr")), "");
}

TEST_P(EveryLayout, OpenExrReadsTheSame) {
  const DeepImage image = sample();
  write(folder_ / "a.exr", image, options());
  EXPECT_EQ(difference(image, readWithOpenExr(folder_ / "a.exr")), "");
}

TEST_P(EveryLayout, BandsAreRowsOfTheWhole) {
  const DeepImage image = sample();
  write(folder_ / "a.exr", image, options());
  Reader reader(folder_ / "a.exr");
  for (int height : {1, 2, 5, 23})
    for (int y = image.dataWindow.y0; y < image.dataWindow.y1; y += height) {
      const int end = std::min(y + height, image.dataWindow.y1);
      EXPECT_EQ(difference(rows(image, y, end), reader.read(y, end)), "") << y << " to " << end;
    }
}

TEST_P(EveryLayout, BandsOfAnyHeightWriteTheSameFile) {
  const DeepImage image = sample();
  write(folder_ / "whole.exr", image, options());
  for (int height : {1, 3, 8}) {
    Writer writer(folder_ / "bands.exr", image, image.dataWindow, options());
    for (int y = image.dataWindow.y0; y < image.dataWindow.y1; y += height)
      writer.write(rows(image, y, std::min(y + height, image.dataWindow.y1)));
    writer.finish();
    EXPECT_EQ(bytesOf(folder_ / "bands.exr"), bytesOf(folder_ / "whole.exr")) << height;
  }
}

TEST_P(EveryLayout, ThreadsDoNotChangeTheFile) {
  const DeepImage image = sample();
  write(folder_ / "many.exr", image, options());
  tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  write(folder_ / "one.exr", image, options());
  EXPECT_EQ(bytesOf(folder_ / "one.exr"), bytesOf(folder_ / "many.exr"));
}

TEST_P(EveryLayout, SampleCountsAloneAndBandEnds) {
  const DeepImage image = sample();
  write(folder_ / "a.exr", image, options());
  Reader reader(folder_ / "a.exr");
  const Buffer<uint32_t> counts = reader.sampleCounts(10, 13);
  const DeepImage band = rows(image, 10, 13);
  ASSERT_EQ(counts.size(), band.pixels());
  for (size_t i = 0; i < counts.size(); ++i) ASSERT_EQ(counts[i], band.count(i)) << i;

  EXPECT_EQ(reader.bandEnd(5, size_t(1) << 30), 28);
  const int step = std::max(1, std::min(GetParam().tileHeight, 23));
  EXPECT_EQ(reader.bandEnd(5, 1), 5 + step);
}

TEST_P(EveryLayout, OnlyTheNamedChannels) {
  const DeepImage image = sample();
  write(folder_ / "a.exr", image, options());
  for (const std::string name : {"A", "Z", "id", "variance.R"}) {
    ReadOptions only;
    only.channels = [&](const std::string& channel) { return channel == name; };
    DeepImage expected = image.copy();
    std::erase_if(expected.channels, [&](const Channel& c) { return c.name != name; });
    EXPECT_EQ(difference(expected, read(folder_ / "a.exr", only)), "") << name;
  }
}

TEST(Io, SizesFromEmptyToWide) {
  TemporaryFolder folder;
  for (int width : {1, 2, 3, 17, 300})
    for (unsigned most : {0u, 1u, 9u}) {
      const DeepImage image = randomDeep({0, 0, width, 3}, {0, 0, width, 3}, kAllTypes, 5, most);
      write(folder / "a.exr", image);
      EXPECT_EQ(difference(image, read(folder / "a.exr")), "") << width << " " << most;
    }
}

TEST(Io, EveryHalfComesBack) {
  TemporaryFolder folder;
  DeepImage image = randomDeep({0, 0, 65536, 1}, {0, 0, 65536, 1}, {}, 1, 0);
  for (size_t i = 0; i <= image.pixels(); ++i) image.offsets[i] = i;
  Channel& channel = image.add("h", PixelType::Half);
  for (size_t i = 0; i < channel.size(); ++i) {
    half h;
    h.setBits(uint16_t(i));
    channel.values[i] = h;
  }
  write(folder / "a.exr", image);
  EXPECT_EQ(difference(image, read(folder / "a.exr")), "");
}

TEST(Io, LongNamesAreForOpenExrToo) {
  TemporaryFolder folder;
  const DeepImage image = randomDeep({0, 0, 5, 4}, {0, 0, 5, 4}, {{std::string(200, 'n'), PixelType::Float}});
  write(folder / "a.exr", image);
  EXPECT_EQ(difference(image, readWithOpenExr(folder / "a.exr")), "");
}

TEST(Io, HeaderSaysWhatWasAskedFor) {
  TemporaryFolder folder;
  WriteOptions options;
  options.compression = Compression::Rle;
  options.tileWidth = 16;
  options.tileHeight = 8;
  write(folder / "a.exr", sample(), options);
  const std::vector<PartInfo> parts = readParts(folder / "a.exr");
  ASSERT_EQ(parts.size(), 1u);
  EXPECT_TRUE(parts[0].deep);
  EXPECT_TRUE(parts[0].tiled);
  EXPECT_EQ(parts[0].tileWidth, 16);
  EXPECT_EQ(parts[0].tileHeight, 8);
  EXPECT_EQ(parts[0].compressionName, "rle");
  EXPECT_EQ(parts[0].dataWindow, (Box{-7, 5, 30, 28}));
  EXPECT_EQ(parts[0].displayWindow, (Box{0, 0, 64, 48}));
  EXPECT_EQ(parts[0].channels.size(), 4u);
  EXPECT_EQ(parts[0].attributes.getInt("maxSamplesPerPixel"), 5);
}

// All attributes of a header but those that a writer decides, as bytes.
std::string attributeBytes(const Attributes& attributes) {
  std::string result;
  const Imf::Header& header = attributes.header();
  for (auto a = header.begin(); a != header.end(); ++a) {
    const std::string name = a.name();
    if (name == "channels" || name == "chunkCount" || name == "maxSamplesPerPixel" || name == "type") continue;
    Imf::Header one;
    one.insert("x", a.attribute());
    result += name + ":" + a.attribute().typeName();
    if (const auto* opaque = dynamic_cast<const Imf::OpaqueAttribute*>(&a.attribute()))
      result.append(&opaque->data()[0], size_t(opaque->dataSize()));
  }
  return result;
}

TEST(Io, AttributesOfEveryKindAreCarried) {
  TemporaryFolder folder;
  DeepImage image = sample();
  Imf::Header header;
  Imf::addOwner(header, "a studio");
  header.insert("views", Imf::StringVectorAttribute({"left", "", "right"}));
  image.attributes = Attributes(header);
  image.attributes.set("fathom:spp", 64);
  image.attributes.set("fathom:ppuScale", 446.5f);
  const std::array<float, 16> matrix = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
  image.attributes.set("worldToCamera", matrix);
  write(folder / "a.exr", image);

  // A type that nobody knows: the name of one attribute's type is changed in the file.
  std::string bytes = bytesOf(folder / "a.exr");
  const size_t at = bytes.find("owner");
  ASSERT_NE(at, std::string::npos);
  bytes.replace(at, 12, std::string("owner\0cheese", 12));
  std::ofstream(folder / "b.exr", std::ios::binary) << bytes;

  const DeepImage back = read(folder / "b.exr");
  EXPECT_EQ(back.attributes.getInt("fathom:spp"), 64);
  EXPECT_EQ(back.attributes.getFloat("fathom:spp"), 64.0f);
  EXPECT_EQ(back.attributes.getFloat("fathom:ppuScale"), 446.5f);
  EXPECT_EQ(back.attributes.getMatrix("worldToCamera"), matrix);
  EXPECT_FALSE(back.attributes.getString("owner"));
  EXPECT_FALSE(back.attributes.getInt("fathom:ppuScale"));
  write(folder / "c.exr", back);
  EXPECT_EQ(attributeBytes(read(folder / "c.exr").attributes), attributeBytes(back.attributes));
  EXPECT_EQ(bytesOf(folder / "c.exr"), bytes);
}

// A file as OpenEXR writes it: a flat part, deep tiles with levels, deep scanlines.
class ManyParts : public ::testing::Test {
 protected:
  ManyParts() : tiles_(without16Bits(2)), lines_(without16Bits(3)), path_(folder_ / "parts.exr") {
    Imf::Header headers[] = {header("beauty", Imf::SCANLINEIMAGE), header("tiles", Imf::DEEPTILE),
                             header("7", Imf::DEEPSCANLINE)};
    headers[0].channels() = Imf::ChannelList();
    headers[0].channels().insert("Y", Imf::Channel(Imf::FLOAT));
    headers[0].compression() = Imf::ZIP_COMPRESSION;
    headers[1].setTileDescription(Imf::TileDescription(16, 8, Imf::MIPMAP_LEVELS));
    headers[2].lineOrder() = Imf::DECREASING_Y;
    Imf::MultiPartOutputFile file(path_.c_str(), headers, 3);
    writeFlat(file);
    writeTiles(file);
    writeLines(file);
  }

  // The frame buffers of tests/reference write no HALF.
  static DeepImage without16Bits(unsigned seed) {
    return randomDeep({-7, 5, 30, 28}, {0, 0, 64, 48},
                      {{"A", PixelType::Float}, {"Z", PixelType::Float}, {"id", PixelType::Uint}}, seed);
  }

  Imf::Header header(const char* name, const std::string& type) const {
    Imf::Header result(64, 48, Imath::Box2i({-7, 5}, {29, 27}));
    result.setName(name);
    result.setType(type);
    result.compression() = Imf::ZIPS_COMPRESSION;
    result.channels().insert("A", Imf::Channel(Imf::FLOAT));
    result.channels().insert("Z", Imf::Channel(Imf::FLOAT));
    result.channels().insert("id", Imf::Channel(Imf::UINT));
    return result;
  }

  void writeFlat(Imf::MultiPartOutputFile& file) {
    for (size_t i = 0; i < flat_.size(); ++i) flat_[i] = float(i);
    Imf::OutputPart part(file, 0);
    Imf::FrameBuffer buffer;
    buffer.insert("Y", flatSlice(flat_));
    part.setFrameBuffer(buffer);
    part.writePixels(23);
  }

  static Imf::Slice flatSlice(std::vector<float>& values) {
    return Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data() + 7 - 5 * 37), 4, 4 * 37);
  }

  void writeTiles(Imf::MultiPartOutputFile& file) {
    Imf::DeepTiledOutputPart part(file, 1);
    reference::Pointers pointers;
    part.setFrameBuffer(reference::frameBuffer(tiles_, pointers));
    for (int level = 0; level < part.numLevels(); ++level)
      part.writeTiles(0, part.numXTiles(level) - 1, 0, part.numYTiles(level) - 1, level);
  }

  void writeLines(Imf::MultiPartOutputFile& file) {
    Imf::DeepScanLineOutputPart part(file, 2);
    reference::Pointers pointers;
    part.setFrameBuffer(reference::frameBuffer(lines_, pointers));
    part.writePixels(23);
  }

  DeepImage readPart(const std::string& path, const std::string& part) {
    ReadOptions options;
    options.part = part;
    return read(path, options);
  }

  TemporaryFolder folder_;
  std::vector<float> flat_ = std::vector<float>(37 * 23);
  DeepImage tiles_, lines_;
  std::string path_;
};

TEST_F(ManyParts, ByNumberByNameAndTheFirstDeepOne) {
  EXPECT_EQ(difference(tiles_, readPart(path_, "")), "");
  EXPECT_EQ(difference(tiles_, readPart(path_, "1")), "");
  EXPECT_EQ(difference(tiles_, readPart(path_, "tiles")), "");
  EXPECT_EQ(difference(lines_, readPart(path_, "2")), "");
  EXPECT_EQ(difference(lines_, readPart(path_, "7")), "");  // a name that looks like a number
  EXPECT_THAT(errorOf([&] { readPart(path_, "beauty"); }), HasSubstr("part 0 (beauty): expected a deep part"));
  EXPECT_THAT(errorOf([&] { readPart(path_, "sky"); }), HasSubstr("expected a part sky, found 3 parts"));
  EXPECT_THAT(errorOf([&] { readPart(path_, "3"); }), HasSubstr("expected a part 3"));
}

TEST_F(ManyParts, AreAllDescribed) {
  const std::vector<PartInfo> parts = readParts(path_);
  ASSERT_EQ(parts.size(), 3u);
  EXPECT_EQ(parts[0].name, "beauty");
  EXPECT_FALSE(parts[0].deep);
  EXPECT_EQ(parts[0].compression, Compression::Zip);
  EXPECT_TRUE(parts[1].deep && parts[1].tiled);
  EXPECT_TRUE(parts[2].deep && !parts[2].tiled);
}

TEST_F(ManyParts, TheOthersAreCopiedWhenOneIsReplaced) {
  for (int replaced : {1, 2}) {
    const DeepImage fresh = sample(9);
    WriteOptions options;
    options.otherPartsOf = path_;
    options.replacedPart = replaced;
    const std::string out = folder_ / "out.exr";
    write(out, fresh, options);
    const DeepImage& kept = replaced == 1 ? lines_ : tiles_;
    EXPECT_EQ(difference(fresh, readWithOpenExr(out, replaced)), "");
    EXPECT_EQ(difference(kept, readWithOpenExr(out, 3 - replaced)), "");
    EXPECT_EQ(difference(fresh, readPart(out, std::to_string(replaced))), "");
    EXPECT_EQ(readParts(out)[1].name, "tiles");
    EXPECT_EQ(readParts(out)[2].name, "7");

    Imf::MultiPartInputFile file(out.c_str());
    Imf::InputPart part(file, 0);
    std::vector<float> values(flat_.size());
    Imf::FrameBuffer buffer;
    buffer.insert("Y", flatSlice(values));
    part.setFrameBuffer(buffer);
    part.readPixels(5, 27);
    EXPECT_EQ(values, flat_);
  }
}

TEST_F(ManyParts, MayReplaceAPartOfTheFileItself) {
  const DeepImage fresh = sample(9);
  WriteOptions options;
  options.otherPartsOf = path_;
  options.replacedPart = 2;
  write(path_, fresh, options);
  EXPECT_EQ(difference(fresh, readPart(path_, "2")), "");
  EXPECT_EQ(difference(tiles_, readPart(path_, "1")), "");
}

TEST(IoWriter, LeavesNothingBehindUnlessFinished) {
  TemporaryFolder folder;
  const DeepImage image = sample();
  {
    Writer writer(folder / "a.exr", image, image.dataWindow);
    writer.write(rows(image, 5, 10));
    EXPECT_THAT(errorOf([&] { writer.finish(); }), HasSubstr("expected rows up to 28, found them up to 10"));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(IoWriter, KeepsTheOldFileUntilTheNewOneIsDone) {
  TemporaryFolder folder;
  const DeepImage image = sample(1), other = sample(2);
  write(folder / "a.exr", image);
  Writer writer(folder / "a.exr", other, other.dataWindow);
  writer.write(other);
  EXPECT_EQ(difference(image, read(folder / "a.exr")), "");
  writer.finish();
  EXPECT_EQ(difference(other, read(folder / "a.exr")), "");
}

TEST(IoWriter, FollowsALink) {
  TemporaryFolder folder;
  write(folder / "a.exr", sample(1));
  std::filesystem::create_symlink(folder / "a.exr", folder / "link.exr");
  write(folder / "link.exr", sample(2));
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.exr"));
  EXPECT_EQ(difference(sample(2), read(folder / "a.exr")), "");
}

TEST(IoWriter, RefusesWhatCannotBeWritten) {
  TemporaryFolder folder;
  const DeepImage image = sample();
  EXPECT_THAT(errorOf([&] { write(folder / "no/a.exr", image); }),
              HasSubstr("no/a.exr: cannot write: No such file or directory"));
  EXPECT_THAT(errorOf([&] { write(folder.path(), image); }), HasSubstr("expected a file, found something else"));
  EXPECT_THAT(errorOf([&] { write("/dev/full", image); }), HasSubstr("/dev/full: cannot write"));

  DeepImage twice = image.copy();
  twice.channels[1].name = "A";
  EXPECT_THAT(errorOf([&] { write(folder / "a.exr", twice); }), HasSubstr("channel A: expected once, found twice"));
  EXPECT_THAT(errorOf([&] { write(folder / "a.exr", image.copyLayout()); }),
              HasSubstr("expected channels, found none"));
  WriteOptions zip;
  zip.compression = Compression::Zip;
  EXPECT_THAT(errorOf([&] { write(folder / "a.exr", image, zip); }),
              HasSubstr("expected compression none, rle or zips"));

  Writer writer(folder / "a.exr", image, image.dataWindow);
  EXPECT_THAT(errorOf([&] { writer.write(rows(image, 6, 8)); }), HasSubstr("expected rows from 5 on"));
  DeepImage less = rows(image, 5, 8);
  less.erase("Z");
  EXPECT_THAT(errorOf([&] { writer.write(less); }), HasSubstr("channel Z: expected in every band"));
}

TEST(IoReader, RefusesWhatIsNoDeepFile) {
  TemporaryFolder folder;
  EXPECT_THAT(errorOf([&] { read(folder / "no.exr"); }), HasSubstr("no.exr: cannot open: No such file or directory"));
  EXPECT_THAT(errorOf([&] { read(folder.path()); }), HasSubstr("expected a file, found something else"));
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THAT(errorOf([&] { read(folder / "pipe"); }), HasSubstr("expected a file, found something else"));
  std::ofstream(folder / "text.exr") << "not an image at all";
  EXPECT_THAT(errorOf([&] { read(folder / "text.exr"); }), HasSubstr("text.exr: not an EXR file"));
  std::ofstream(folder / "empty.exr") << "";
  EXPECT_THAT(errorOf([&] { read(folder / "empty.exr"); }), HasSubstr("empty.exr: not an EXR file"));
}

TEST(IoReader, ChecksRowsAndMemory) {
  TemporaryFolder folder;
  write(folder / "a.exr", sample());
  Reader reader(folder / "a.exr");
  EXPECT_THAT(errorOf([&] { reader.read(4, 10); }), HasSubstr("expected rows within 5 to 28, found 4 to 10"));
  EXPECT_THAT(errorOf([&] { reader.read(20, 29); }), HasSubstr("expected rows within"));
  EXPECT_TRUE(reader.read(9, 9).dataWindow.empty());
  ReadOptions small;
  small.memoryLimit = 20000;
  EXPECT_THAT(errorOf([&] { read(folder / "a.exr", small); }), HasSubstr("more than the memory limit"));
  EXPECT_EQ(Reader(folder / "a.exr", small).read(6, 8).dataWindow.height(), 2);
}

}  // namespace
}  // namespace fathom::deep
