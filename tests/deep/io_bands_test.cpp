// What a reader says of bands, rows and memory, counted from the image itself.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "base/error.h"
#include "deep/io.h"
#include "tests/reference/random_deep.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::deep {
namespace {

using reference::randomDeep;
using ::testing::HasSubstr;

class IoBands : public ::testing::Test {
 protected:
  void make(int tileWidth = 0, int tileHeight = 0) {
    WriteOptions options;
    options.tileWidth = tileWidth;
    options.tileHeight = tileHeight;
    write(path_, image_, options);
  }

  // The bytes of rows [y0, y1) as decoded: an offset and a count for each pixel, four bytes for each value.
  size_t bytesOf(int y0, int y1, size_t channels) const {
    const DeepImage band = rows(image_, y0, y1);
    return (sizeof(uint64_t) + sizeof(uint32_t)) * band.pixels() + 4 * channels * band.samples();
  }

  std::string errorOf(const std::function<void(Reader&)>& call, const ReadOptions& options = {}) const {
    Reader reader(path_, options);
    try {
      call(reader);
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  }

  TemporaryFolder folder_;
  std::string path_ = folder_ / "a.exr";
  DeepImage image_ = randomDeep({-7, 5, 30, 47}, {0, 0, 64, 48},
                                {{"A", PixelType::Half}, {"Z", PixelType::Float}, {"id", PixelType::Uint}});
};

TEST_F(IoBands, TakeAsManyRowsAsFit) {
  make();
  for (const size_t channels : {3, 1}) {
    ReadOptions options;
    if (channels == 1) options.channels = [](const std::string& name) { return name == "A"; };
    Reader reader(path_, options);
    for (int y0 : {5, 6, 30})
      for (int y1 = y0 + 1; y1 < 47; ++y1) {
        EXPECT_EQ(reader.bandEnd(y0, bytesOf(y0, y1, channels)), y1) << y0;
        EXPECT_EQ(reader.bandEnd(y0, bytesOf(y0, y1, channels) - 1), std::max(y1 - 1, y0 + 1)) << y0;
      }
  }
}

TEST_F(IoBands, TakeAsManyRowsOfTilesAsFit) {
  make(16, 10);
  Reader reader(path_);
  for (int y1 : {15, 25, 35, 45}) {
    EXPECT_EQ(reader.bandEnd(5, bytesOf(5, y1, 3)), y1);
    EXPECT_EQ(reader.bandEnd(5, bytesOf(5, y1, 3) - 1), std::max(y1 - 10, 15));
  }
}

TEST_F(IoBands, AreHeldToTheMemoryLimit) {
  make();
  const size_t counts = 4 * image_.pixels(), offsets = 12 * image_.pixels(), whole = bytesOf(5, 47, 3);
  ReadOptions options;
  const auto limited = [&](size_t limit, auto call) {
    options.memoryLimit = limit;
    return errorOf(call, options);
  };
  const auto countAll = [](Reader& r) { r.sampleCounts(5, 47); };
  const auto readAll = [](Reader& r) { r.read(); };
  EXPECT_THAT(limited(counts - 1, countAll), HasSubstr("a.exr, rows 5 to 46: sample counts would take"));
  EXPECT_EQ(limited(counts, countAll), "no error");
  EXPECT_THAT(limited(offsets - 1, readAll), HasSubstr("a.exr, rows 5 to 46: sample counts would take"));
  EXPECT_THAT(limited(offsets, readAll), HasSubstr("a.exr, rows 5 to 46: samples would take"));
  EXPECT_THAT(limited(whole - 1, readAll), HasSubstr("a.exr, rows 5 to 46: samples would take"));
  EXPECT_EQ(limited(whole, readAll), "no error");
}

// A chunk is unpacked whole, whichever channels are wanted of it.
TEST_F(IoBands, CountChannelsThatAreUnpackedInVain) {
  std::vector<reference::NamedType> channels;
  for (char name = 'a'; name <= 't'; ++name) channels.push_back({std::string(1, name), PixelType::Float});
  image_ = randomDeep({0, 0, 4, 1}, {0, 0, 4, 1}, channels, 1, 1000);
  make();
  ReadOptions one;
  one.channels = [](const std::string& name) { return name == "c"; };
  one.memoryLimit = 20 * 4 * image_.samples() - 1;
  EXPECT_THAT(errorOf([](Reader& r) { r.read(); }, one), HasSubstr("rows 0 to 0: samples would take"));
  ++one.memoryLimit;
  EXPECT_EQ(errorOf([](Reader& r) { r.read(); }, one), "no error");
}

TEST_F(IoBands, EndBehindTheirBeginning) {
  make();
  EXPECT_THAT(errorOf([](Reader& r) { r.read(10, 9); }), HasSubstr("expected rows within 5 to 47, found 10 to 9"));
}

TEST_F(IoBands, OfPartsWithNumbersOfAnyLengthAreRefused) {
  make();
  for (const std::string part : {"1", "123456789", "99999999999999999999"}) {
    ReadOptions options;
    options.part = part;
    try {
      Reader reader(path_, options);
      ADD_FAILURE() << part;
    } catch (const Error& e) {
      EXPECT_EQ(e.what(), path_ + ": expected a part " + part + ", found 1 parts");
    }
  }
}

}  // namespace
}  // namespace fathom::deep
