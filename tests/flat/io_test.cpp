// Flat images through files: what is written comes back, and what is broken is refused in one line.
#include "flat/io.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "base/error.h"
#include "tests/reference/flat_read_error.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::flat {
namespace {

using reference::errorOf;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::UnorderedElementsAre;

// A data window off the origin, smaller than the display window, with planes whose values tell their place.
Image makeImage() {
  Image image{{-3, 5, 10, 105}, {0, 0, 40, 120}, {}, {}};
  float step = 0;
  for (const char* name : {"R", "G", "B", "A", "Z", "albedo.R", "variance.R"}) {
    Plane& plane = image.add(name);
    step += 0.37f;
    for (size_t i = 0; i < plane.values.size(); ++i) plane.values[i] = step * float(i) - 7;
  }
  return image;
}

std::string readBytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void writeBytes(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

TEST(FlatIo, FloatComesBackBitForBit) {
  const TemporaryFolder folder;
  Image image = makeImage();
  image.planes[0].values[3] = std::numeric_limits<float>::infinity();
  image.planes[0].values[4] = std::numeric_limits<float>::denorm_min();
  write(folder / "a.exr", image);
  const Image back = read(folder / "a.exr");
  EXPECT_EQ(back.dataWindow, image.dataWindow);
  EXPECT_EQ(back.displayWindow, image.displayWindow);
  ASSERT_EQ(back.planes.size(), image.planes.size());
  for (const Plane& plane : image.planes)
    EXPECT_TRUE(std::ranges::equal(back.get(plane.name).values, plane.values)) << plane.name;
}

TEST(FlatIo, UintChannelsAreReadByValue) {
  const TemporaryFolder folder;
  std::vector<uint32_t> ids(4096);
  for (size_t i = 0; i < ids.size(); ++i) ids[i] = uint32_t(1021 * i);
  Imf::Header header(4096, 1);
  header.channels().insert("id", Imf::Channel(Imf::UINT));
  {
    Imf::OutputFile file((folder / "ids.exr").c_str(), header);
    Imf::FrameBuffer frame;
    frame.insert("id", Imf::Slice(Imf::UINT, reinterpret_cast<char*>(ids.data()), sizeof ids[0], 0));
    file.setFrameBuffer(frame);
    file.writePixels(1);
  }
  const Image image = read(folder / "ids.exr");
  for (size_t i = 0; i < ids.size(); ++i) ASSERT_EQ(image.get("id").values[i], float(ids[i]));
}

TEST(FlatIo, HalfKeepsTheRangeOfDepthsAndVariances) {
  const TemporaryFolder folder;
  Image image = makeImage();
  image.find("Z")->values[0] = 1e6f;
  image.find("variance.R")->values[0] = 1e-12f;
  image.find("R")->values[0] = 0.1f;
  write(folder / "a.exr", image, {.half = true});
  const Image back = read(folder / "a.exr");
  EXPECT_EQ(back.get("Z").values[0], 1e6f);
  EXPECT_EQ(back.get("variance.R").values[0], 1e-12f);
  EXPECT_NE(back.get("R").values[0], 0.1f);
  EXPECT_NEAR(back.get("R").values[0], 0.1f, 1e-4f);
}

TEST(FlatIo, AttributesKeepTypeAndText) {
  const TemporaryFolder folder;
  Image image = makeImage();
  const std::map<std::string, std::string> attributes = {
      {"fathom:spp", "32"},
      {"fathom:ppuScale", "182.803"},
      {"whole", "5.0"},
      {"vector", "1.5, -2.0"},
      {"ints", "1, 2, 3"},
      {"worldToCamera", "0.5, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1e-20, 0.0, 3.0, 4.0, 5.0, 1.0"},
      {"note", "made, by hand: 100 %"},
      {"looksLikeANumber", "\"42\""},
  };
  image.attributes = attributes;
  write(folder / "a.exr", image);
  const Image once = read(folder / "a.exr");
  for (const auto& [name, text] : attributes) {
    ASSERT_TRUE(once.attributes.contains(name)) << name;
    EXPECT_EQ(once.attributes.at(name), text) << name;
  }
  for (const char* encoding : {"compression", "version", "oiio:ColorSpace"})
    EXPECT_FALSE(once.attributes.contains(encoding));
  write(folder / "b.exr", once);
  EXPECT_EQ(read(folder / "b.exr").attributes, once.attributes);
}

TEST(FlatIo, NoFileTellsWhenItWasWritten) {
  const TemporaryFolder folder;
  write(folder / "a.exr", makeImage());
  EXPECT_EQ(read(folder / "a.exr").attributes["DateTime"], "");
  Image dated = makeImage();
  dated.attributes["DateTime"] = "2026:01:02 03:04:05";
  write(folder / "b.exr", dated);
  EXPECT_EQ(read(folder / "b.exr").attributes["DateTime"], "2026:01:02 03:04:05");
}

TEST(FlatIo, NothingIsLeftWhereWritingFails) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "taken.exr");
  std::filesystem::create_directory(folder / "taken.exr/by a folder");
  EXPECT_THROW(write(folder / "taken.exr", makeImage()), Error);
  EXPECT_THROW(write(folder / "no/such/folder.exr", makeImage()), Error);
  EXPECT_THROW(write(folder / "empty.exr", Image{}), Error);
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) names.push_back(entry.path().filename());
  EXPECT_THAT(names, UnorderedElementsAre("taken.exr"));
}

TEST(FlatIo, PngClampsAndRounds) {
  const TemporaryFolder folder;
  Image image{{5, 5, 9, 6}, {0, 0, 20, 20}, {}, {}};
  for (const char* name : {"R", "G", "B"}) image.add(name);
  const float values[4] = {-1, 0.2f, 7, std::nanf("")};
  for (int i = 0; i < 4; ++i) image.planes[0].values[i] = values[i];
  writePng(folder / "a.png", image);
  const Image back = read(folder / "a.png");
  ASSERT_EQ(back.dataWindow, (Box{0, 0, 4, 1}));
  EXPECT_EQ(back.get("R").values[0], 0);
  EXPECT_FLOAT_EQ(back.get("R").values[1], 51.0f / 255);
  EXPECT_EQ(back.get("R").values[2], 1);
  EXPECT_EQ(back.get("R").values[3], 0);
  EXPECT_EQ(back.get("G").values[2], 0);
}

TEST(FlatIo, WrongFilesAreRefusedInOneLine) {
  const TemporaryFolder folder;
  EXPECT_THAT(errorOf(folder / "none.exr"), AllOf(HasSubstr("none.exr: expected"), HasSubstr("No such file")));
  writeBytes(folder / "text.exr", "hello");
  EXPECT_THAT(errorOf(folder / "text.exr"), HasSubstr("text.exr: expected an OpenEXR file"));
  writeBytes(folder / "what.ever", "hello");
  EXPECT_THAT(errorOf(folder / "what.ever"), HasSubstr("what.ever: expected an image file"));
  EXPECT_THAT(errorOf(folder / ""), HasSubstr("expected"));
  write(folder / "a.exr", makeImage());
  EXPECT_THAT(errorOf(folder / "a.exr", {.part = "7"}),
              HasSubstr("a.exr: expected a part 7, found 1 part(s) without it"));
  EXPECT_THAT(errorOf(folder / "a.exr", {.memoryLimit = 1000}), HasSubstr("a.exr, part 0: expected at most"));
  EXPECT_EQ(errorOf(folder / "a.exr", {.part = "0"}), "");
}

TEST(FlatIo, EveryTruncationIsRefused) {
  const TemporaryFolder folder;
  write(folder / "a.exr", makeImage());
  const std::string whole = readBytes(folder / "a.exr");
  for (size_t size = 0; size < whole.size(); size += size < 2000 ? 7 : 97) {
    writeBytes(folder / "cut.exr", whole.substr(0, size));
    const std::string error = errorOf(folder / "cut.exr");
    EXPECT_THAT(error, AllOf(HasSubstr("cut.exr"), Not(HasSubstr("\n")))) << size;
  }
}

TEST(FlatIo, EveryFlippedByteOfTheHeaderEndsInAnImageOrALine) {
  const TemporaryFolder folder;
  write(folder / "a.exr", makeImage());
  const std::string whole = readBytes(folder / "a.exr");
  for (size_t at = 0; at < 700; ++at) {
    std::string bytes = whole;
    bytes[at] = char(bytes[at] ^ 0xff);
    writeBytes(folder / "flipped.exr", bytes);
    EXPECT_THAT(errorOf(folder / "flipped.exr", {.memoryLimit = 1 << 20}), Not(HasSubstr("\n"))) << at;
  }
}

TEST(FlatIo, AHeaderThatPromisesTooMuchIsRefusedBeforeAllocation) {
  const TemporaryFolder folder;
  write(folder / "a.exr", makeImage());
  std::string bytes = readBytes(folder / "a.exr");
  // name, type and size, then min.x, min.y, max.x, max.y.
  const size_t at = bytes.find("dataWindow") + sizeof "dataWindow" + sizeof "box2i" + 4;
  bytes[at + 11] = 0x3f;
  writeBytes(folder / "huge.exr", bytes);
  EXPECT_THAT(errorOf(folder / "huge.exr"),
              HasSubstr("huge.exr, part 0: expected at most 8590 MB of pixels, found a header that"));
}

TEST(FlatIo, PngOfOneChannelIsGrey) {
  const TemporaryFolder folder;
  Image image{{5, 5, 8, 6}, {0, 0, 20, 20}, {}, {}};
  image.add("Y");
  for (size_t i = 0; i < 3; ++i) image.planes[0].values[i] = float(i) / 5;
  writePng(folder / "a.png", image);
  const Image back = read(folder / "a.png");
  ASSERT_EQ(back.planes.size(), 1u);
  for (size_t i = 0; i < 3; ++i) EXPECT_FLOAT_EQ(back.planes[0].values[i], float(51 * i) / 255);
  EXPECT_THAT(errorOf(folder / "a.png", {.memoryLimit = 11}), HasSubstr("a.png, part 0: expected at most"));
  EXPECT_EQ(errorOf(folder / "a.png", {.memoryLimit = 12}), "");
  Image empty{{5, 5, 5, 6}, {0, 0, 20, 20}, {}, {}};
  empty.add("Y");
  try {
    writePng(folder / "b.png", empty);
    ADD_FAILURE();
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("b.png: expected an image to write, found an empty one"));
  }
  image.planes[0].name = "Z";
  EXPECT_THROW(writePng(folder / "b.png", image), Error);
  EXPECT_FALSE(std::filesystem::exists(folder / "b.png"));
}

}  // namespace
}  // namespace fathom::flat
