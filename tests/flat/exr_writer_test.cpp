// Flat EXR files as they are written: in bands, in halves, with the header that OpenEXR knows.
#include "flat/exr_writer.h"

#include <OpenEXR/ImfChromaticitiesAttribute.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfMatrixAttribute.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <utility>

#include "base/error.h"
#include "tests/reference/error_of.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::flat {
namespace {

using reference::errorOf;
using ::testing::HasSubstr;

// Planes whose values tell their place.
Image makeImage(const std::vector<std::string>& names = {"R", "A", "Z"}) {
  Image image{{-3, 5, 10, 105}, {0, 0, 40, 120}, {}, {}};
  float step = 0;
  for (const std::string& name : names) {
    Plane& plane = image.add(name);
    step += 0.37f;
    for (size_t i = 0; i < plane.values.size(); ++i) plane.values[i] = step * float(i) - 7;
  }
  return image;
}

std::string bytesOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

Image rowsOf(const Image& image, int y0, int y1) {
  return crop(image, {image.dataWindow.x0, y0, image.dataWindow.x1, y1});
}

TEST(ExrWriter, BandsOfAnyHeightMakeTheSameFile) {
  const TemporaryFolder folder;
  const Image image = makeImage();
  write(folder / "whole.exr", image);
  for (const int height : {1, 3, 16, 17, 40}) {
    ExrWriter writer(folder / "bands.exr", image, image.dataWindow, {});
    for (int y = 5; y < 105; y += height) writer.write(rowsOf(image, y, std::min(y + height, 105)));
    writer.finish();
    EXPECT_EQ(bytesOf(folder / "bands.exr"), bytesOf(folder / "whole.exr")) << height;
  }
}

TEST(ExrWriter, RefusesWhatIsNotNext) {
  const TemporaryFolder folder;
  const Image image = makeImage();
  ExrWriter writer(folder / "a.exr", image, image.dataWindow, {});
  writer.write(rowsOf(image, 5, 20));
  const std::string expected = "a.exr: expected 3 planes and rows from 20 on, columns -3 to 10; found ";
  EXPECT_THAT(errorOf([&] { writer.write(rowsOf(image, 19, 30)); }),
              HasSubstr(expected + "3 planes and rows from 19 on, columns -3 to 10"));
  for (const Box& box : {Box{-2, 20, 10, 21}, Box{-3, 20, 9, 21}})
    EXPECT_THAT(errorOf([&] { writer.write(crop(image, box)); }), HasSubstr(expected));
  Image more = rowsOf(image, 20, 21);
  more.add("more");
  EXPECT_THAT(errorOf([&] { writer.write(more); }), HasSubstr(expected + "4 planes"));
  Image longer = makeImage();
  longer.dataWindow = {-3, 20, 10, 120};
  EXPECT_THAT(errorOf([&] { writer.write(longer); }), HasSubstr(expected));
  EXPECT_THAT(errorOf([&] { writer.finish(); }), HasSubstr("a.exr: expected rows up to 105, found them up to 20"));
}

TEST(ExrWriter, RefusesTwoPlanesOfOneName) {
  const TemporaryFolder folder;
  EXPECT_THAT(errorOf([&] {
                write(folder / "a.exr", makeImage({"R", "G", "R"}));
              }),
              HasSubstr("a.exr, channel R: expected once, found twice"));
}

TEST(ExrWriter, DepthsCountsVariancesAndCryptomattesAreNeverHalves) {
  const TemporaryFolder folder;
  const std::vector<std::string> whole = {"Z",          "ZBack",        "Z.front", "samples", "half0.samples",
                                          "variance.R", "variance.N.X", "ids00.R"},
                                 halves = {"R", "albedo.R", "idle.R", "coverage", "Zebra"};
  std::vector<std::string> all = whole;
  all.insert(all.end(), halves.begin(), halves.end());
  Image image = makeImage(all);
  for (Plane& plane : image.planes) plane.values.fill(1.0f / 3);
  image.attributes = {{"cryptomatte/1234567/name", "ids"}, {"cryptomatte/1234567/hash", "idle"}, {"x/name", "R"}};
  write(folder / "a.exr", image, {.half = true});
  const Image back = read(folder / "a.exr");
  for (const std::string& name : whole) EXPECT_EQ(back.get(name).values[7], 1.0f / 3) << name;
  // The nearest to a third of those with eleven bits.
  for (const std::string& name : halves) EXPECT_EQ(back.get(name).values[7], 1365.0f / 4096) << name;
}

TEST(ExrWriter, WhatIsTooLargeForHalfIsTheLargest) {
  const TemporaryFolder folder;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Image image = makeImage({"R"});
  std::ranges::copy(std::vector<float>{65504, 65520, -1e30f, kInfinity, -kInfinity, 1}, image.planes[0].values.begin());
  write(folder / "a.exr", image, {.half = true});
  const Image back = read(folder / "a.exr");
  const auto& values = back.get("R").values;
  EXPECT_THAT(std::vector<float>(values.begin(), values.begin() + 6),
              ::testing::ElementsAre(65504, 65504, -65504, kInfinity, -kInfinity, 1));
}

TEST(ExrWriter, AnnouncesLongNames) {
  const TemporaryFolder folder;
  for (const size_t length : {31, 32}) {
    const std::string name(length, 'n');
    Image attribute = makeImage();
    attribute.attributes[name] = "7";
    const Image channel = makeImage({name});
    for (const Image* image : {&channel, &std::as_const(attribute)}) {
      write(folder / "a.exr", *image);
      const Imf::InputFile file((folder / "a.exr").c_str());
      EXPECT_EQ((file.version() & 0x400) != 0, length > 31) << length;
    }
  }
}

TEST(ExrWriter, AttributesHaveTheNamesAndTypesOfOpenExr) {
  const TemporaryFolder folder;
  Image image = makeImage();
  const std::string red = "0.7, 0.3", others = "0.2, 0.8, 0.1, 0.05, 0.3, 0.32";
  image.attributes = {
      {"Copyright", "a studio"},
      {"PixelAspectRatio", "2.0"},
      {"worldtoscreen", "1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 4.0, 5.0, 6.0, 1.0"},
      {"chromaticities", red + ", " + others},
      {"m33", "1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.5"},
      {"fives", "1.0, 2.0, 3.0, 4.0, 5.0"},
      {"screenWindowWidth", "wide"},
      {"displayWindow", "3"},
      {"lineOrder", "random"},
      {"tiles", "7"}};
  write(folder / "a.exr", image);
  {
    const Imf::InputFile file((folder / "a.exr").c_str());
    const Imf::Header& header = file.header();
    EXPECT_EQ(header.typedAttribute<Imf::StringAttribute>("owner").value(), "a studio");
    EXPECT_EQ(header.pixelAspectRatio(), 2);
    EXPECT_EQ(header.typedAttribute<Imf::M44fAttribute>("worldToNDC").value()[3][1], 5);
    EXPECT_EQ(header.typedAttribute<Imf::ChromaticitiesAttribute>("chromaticities").value().green.y, 0.8f);
    EXPECT_EQ(header.typedAttribute<Imf::M33fAttribute>("m33").value()[2][2], 9.5f);
    EXPECT_EQ(header.find("fives"), header.end());
    // What a header always has, stays.
    EXPECT_EQ(header.screenWindowWidth(), 1);
    EXPECT_EQ(header.displayWindow().max.x, 39);
    EXPECT_EQ(header.find("tiles"), header.end());
  }
  const Image back = read(folder / "a.exr");
  for (const char* name : {"Copyright", "chromaticities", "m33"})
    EXPECT_EQ(back.attributes.at(name), image.attributes.at(name)) << name;
}

}  // namespace
}  // namespace fathom::flat
