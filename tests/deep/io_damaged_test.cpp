// Damaged deep files: cut, flipped and crafted. Each gives an image or one line, before memory is spent on a promise.
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfStringVectorAttribute.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>

#include "base/error.h"
#include "deep/exr_file.h"
#include "deep/io.h"
#include "tests/reference/random_deep.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::deep {
namespace {

using reference::randomDeep;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

std::string bytesOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

// A file that can be changed and read again.
class Damaged : public ::testing::Test {
 protected:
  void make(Compression compression, int tile = 0, const Box& window = {0, 0, 6, 5}) {
    WriteOptions options;
    options.compression = compression;
    options.tileWidth = options.tileHeight = tile;
    write(path_,
          randomDeep(window, window, {{"A", PixelType::Half}, {"Z", PixelType::Float}, {"id", PixelType::Uint}}, 4),
          options);
    bytes_ = bytesOf(path_);
  }

  // The error of reading these bytes; empty where they are an image.
  std::string errorOf(const std::string& bytes, size_t memoryLimit = size_t(1) << 26) {
    std::filesystem::remove(path_);  // a file that is truncated and written again may be flushed to the disk: slow
    std::ofstream(path_, std::ios::binary) << bytes;
    ReadOptions options;
    options.memoryLimit = memoryLimit;
    try {
      read(path_, options);
    } catch (const Error& e) {
      return e.what();
    }
    return {};
  }

  // Where the chunk of a row begins.
  uint64_t chunk(size_t row) {
    ExrFile file(path_);
    return file.chunkTable(file.parts()[0]).at(row);
  }

  template <class T>
  std::string with(size_t at, T value) {
    std::string result = bytes_;
    std::memcpy(result.data() + at, &value, sizeof(value));
    return result;
  }

  TemporaryFolder folder_;
  std::string path_ = folder_ / "a.exr", bytes_;
};

void forEachLayout(const std::function<void(Compression, int)>& run) {
  for (Compression compression : {Compression::None, Compression::Rle, Compression::Zips})
    for (int tile : {0, 4}) run(compression, tile);
}

TEST_F(Damaged, EveryTruncationIsToldAndNamesTheFile) {
  forEachLayout([&](Compression compression, int tile) {
    make(compression, tile);
    ASSERT_EQ(errorOf(bytes_), "");
    for (size_t size = 0; size < bytes_.size(); ++size) {
      const std::string error = errorOf(bytes_.substr(0, size));
      ASSERT_THAT(error, AllOf(HasSubstr("a.exr"), Not(HasSubstr("\n")))) << size << " of " << bytes_.size();
    }
  });
}

TEST_F(Damaged, FlippedBitsAreAnImageOrALine) {
  forEachLayout([&](Compression compression, int tile) {
    make(compression, tile);
    for (size_t at = 0; at < bytes_.size(); ++at)
      for (int flip : {0x01, 0x80, 0xff}) {
        const std::string error = errorOf(with(at, char(bytes_[at] ^ flip)));
        ASSERT_THAT(error, Not(HasSubstr("\n"))) << at;
      }
  });
}

TEST_F(Damaged, ARowThatPromisesTooManySamples) {
  make(Compression::Zips);
  EXPECT_THAT(errorOf(with(chunk(1) + 20, uint64_t(1) << 40)),
              HasSubstr("a.exr, row 1: expected 1099511627776 bytes of samples, found only"));
  EXPECT_THAT(errorOf(with(chunk(1) + 20, ~uint64_t(0))), HasSubstr("row 1: expected 18446744073709551615 bytes"));
  EXPECT_THAT(errorOf(with(chunk(1) + 12, uint64_t(1) << 60)), HasSubstr("row 1: expected"));
  EXPECT_THAT(errorOf(with(chunk(1) + 4, uint64_t(1) << 60)), HasSubstr("row 1: expected"));
  EXPECT_THAT(errorOf(with(chunk(1) + 4, ~uint64_t(0))), HasSubstr("row 1: expected"));
}

TEST_F(Damaged, CountsThatDoNotFitTheSamples) {
  make(Compression::None);
  const uint64_t counts = chunk(1) + 28;
  EXPECT_THAT(errorOf(with(counts + 20, uint32_t(0x7fffffff))), HasSubstr("expected 2147483647 samples of 10 bytes"));
  EXPECT_THAT(errorOf(with(counts, uint32_t(0xffffffff))),
              HasSubstr("expected running sample counts of at least 4294967295"));
}

TEST_F(Damaged, AHugeDataWindowIsRefusedBeforeAnythingIsAllocated) {
  make(Compression::Zips);
  const size_t window = bytes_.find("dataWindow") + 11 + 6 + 4;
  EXPECT_THAT(errorOf(with(window + 12, int32_t(500000000))), HasSubstr("expected a table of 500000001 chunks"));
  EXPECT_THAT(errorOf(with(window + 8, int32_t(1000000000))), HasSubstr("more than the memory limit"));
  EXPECT_THAT(errorOf(with(window + 8, int32_t(100000))), HasSubstr("expected 100001 sample counts, found"));
  EXPECT_THAT(errorOf(with(window + 8, int32_t(-5))), HasSubstr("Invalid data window"));
}

TEST_F(Damaged, ATableThatLeadsAstray) {
  make(Compression::Zips);
  const uint64_t first = chunk(0), second = chunk(1);
  const size_t table = size_t(first) - 5 * 8;
  EXPECT_THAT(errorOf(with(table, uint64_t(0))), HasSubstr("row 0: missing: the file was not finished"));
  EXPECT_THAT(errorOf(with(table, second)), HasSubstr("row 0: expected its start at byte"));
  EXPECT_THAT(errorOf(with(table, uint64_t(1) << 50)), HasSubstr("damaged or truncated"));
  EXPECT_THAT(errorOf(with(table, ~uint64_t(0))), HasSubstr("damaged or truncated"));
}

TEST_F(Damaged, AttributesThatPromiseTooMuch) {
  make(Compression::Zips);
  const size_t size = bytes_.find("channels") + 9 + 7;
  EXPECT_THAT(errorOf(with(size, int32_t(0x7fffffff))), HasSubstr("attribute channels: expected a size of at most"));
  EXPECT_THAT(errorOf(with(size, int32_t(-1))), HasSubstr("attribute channels: expected a size of at most"));
  EXPECT_THAT(errorOf(with(4, uint32_t(0x802 | 0x8000))), HasSubstr("expected version 2 of EXR"));
}

// OpenEXR's library goes by what is in a value, and would take what follows for sizes that nobody has looked at.
TEST_F(Damaged, AttributesWhoseSizeIsNotThatOfWhatIsInThem) {
  make(Compression::Zips);
  const size_t list = bytes_.find("chlist") + 7, first = bytes_.find('A', list), second = bytes_.find('Z', first);
  ASSERT_EQ(second - first, 18u);
  EXPECT_THAT(errorOf(with(second, char(0))), HasSubstr("attribute channels: expected channels that end with its"));
  EXPECT_THAT(errorOf(with(list, int32_t(18 + 18 + 19))), HasSubstr("attribute channels: expected channels that end"));
  const size_t size = bytes_.find("v2f") + 4;
  EXPECT_THAT(errorOf(with(size, int32_t(4))),
              HasSubstr("attribute screenWindowCenter: expected 8 bytes for its type v2f, found 4"));
}

TEST_F(Damaged, StringsThatAreLongerThanTheirAttribute) {
  DeepImage image = randomDeep({0, 0, 6, 5}, {0, 0, 6, 5}, {{"A", PixelType::Half}});
  Imf::Header header;
  header.insert("views", Imf::StringVectorAttribute({"left", "right"}));
  image.attributes = Attributes(header);
  write(path_, image);
  bytes_ = bytesOf(path_);
  ASSERT_EQ(errorOf(bytes_), "");
  const size_t first = bytes_.find("stringvector") + 13 + 4;
  const std::string expected = "a.exr: attribute views: expected strings within 17 bytes, found one of ";
  EXPECT_THAT(errorOf(with(first, int32_t(14))), HasSubstr(expected + "14"));
  EXPECT_THAT(errorOf(with(first, int32_t(-1))), HasSubstr(expected + "4294967295"));
  EXPECT_THAT(errorOf(with(first + 8, int32_t(6))), HasSubstr(expected + "6"));
}

TEST_F(Damaged, NamesMayHave255Letters) {
  make(Compression::Zips);
  DeepImage image = read(path_);
  EXPECT_THAT(errorOf(std::string(bytes_).insert(bytes_.find("channels"), 300, 'n')),
              HasSubstr("a.exr: header: expected a name of at most 255 letters, found a longer one"));
  image.attributes.set(std::string(255, 'n'), 7);
  write(path_, image);
  EXPECT_EQ(read(path_).attributes.getInt(std::string(255, 'n')), 7);
}

TEST_F(Damaged, StandardAttributesOfAnotherTypeAreNoHindranceToWriting) {
  make(Compression::Zips);
  for (const std::string name : {"chunkCount", "maxSamplesPerPixel", "version"}) {
    ASSERT_EQ(errorOf(with(bytes_.find(name) + name.size() + 1, 'j')), "") << name;
    EXPECT_NO_THROW(write(folder_ / "b.exr", read(path_))) << name;
  }
}

TEST_F(Damaged, TilesAreNamedByTheirPlace) {
  make(Compression::Zips, 4, {10, 20, 16, 25});
  const size_t table = size_t(chunk(0)) - 4 * 8;
  EXPECT_THAT(errorOf(with(table + 8, uint64_t(0))), HasSubstr("a.exr, tile at 14 20: missing"));
  EXPECT_THAT(errorOf(with(table + 16, uint64_t(0))), HasSubstr("a.exr, tile at 10 24: missing"));
}

TEST_F(Damaged, ChannelsOfAnotherSamplingAreRefused) {
  make(Compression::Zips);
  // Behind the name: the type, a flag with three empty bytes, and the two samplings.
  const size_t sampling = bytes_.find("Z", bytes_.find("chlist") + 11) + 2 + 8;
  EXPECT_THAT(errorOf(with(sampling, int32_t(2))), AllOf(HasSubstr("a.exr: header: "), HasSubstr("\"Z\"")));
  EXPECT_THAT(errorOf(with(sampling + 4, int32_t(5))), AllOf(HasSubstr("a.exr: header: "), HasSubstr("\"Z\"")));
}

TEST_F(Damaged, CompressionsThatAreNotForDeepParts) {
  make(Compression::Zips);
  const size_t value = bytes_.find("compression", bytes_.find("compression") + 11) + 12 + 4;
  for (int other : {3, 4, 9, 200}) EXPECT_THAT(errorOf(with(value, uint8_t(other))), HasSubstr("a.exr")) << other;
}

}  // namespace
}  // namespace fathom::deep
