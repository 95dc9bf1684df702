// What a writer declares, carries and refuses.
#include <OpenEXR/ImfBoxAttribute.h>
#include <OpenEXR/ImfChromaticitiesAttribute.h>
#include <OpenEXR/ImfDeepImageStateAttribute.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfEnvmapAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFloatVectorAttribute.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfKeyCodeAttribute.h>
#include <OpenEXR/ImfLineOrderAttribute.h>
#include <OpenEXR/ImfMatrixAttribute.h>
#include <OpenEXR/ImfPreviewImageAttribute.h>
#include <OpenEXR/ImfRationalAttribute.h>
#include <OpenEXR/ImfStdIO.h>
#include <OpenEXR/ImfStringVectorAttribute.h>
#include <OpenEXR/ImfTileDescriptionAttribute.h>
#include <OpenEXR/ImfTimeCodeAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <utility>

#include "base/error.h"
#include "deep/io.h"
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

DeepImage sample() {
  return randomDeep({-7, 5, 30, 28}, {0, 0, 64, 48}, {{"A", PixelType::Half}, {"Z", PixelType::Float}});
}

std::string valueOf(const Imf::Attribute& attribute) {
  Imf::StdOSStream stream;
  attribute.writeValueTo(stream, 2);
  return stream.str();
}

// Also one that is larger than what a header is read in at once.
TEST(IoWriter, AttributesOfAllTypesComeBack) {
  Imf::Header header;
  const Imath::M33d matrix3(1, 2, 3, 4, 5, 6, 7, 8, 9);
  const Imath::M44d matrix4(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16);
  Imf::PreviewImage preview(150, 150);
  for (unsigned i = 0; i < 150 * 150; ++i) preview.pixels()[i] = {uint8_t(i), uint8_t(i >> 8), 7, 255};
  header.insert("x box2i", Imf::Box2iAttribute({{1, 2}, {3, 4}}));
  header.insert("x box2f", Imf::Box2fAttribute({{1, 2}, {3, 4.5f}}));
  header.insert("x chromaticities", Imf::ChromaticitiesAttribute(Imf::Chromaticities({0.1f, 0.2f}, {0.3f, 0.4f})));
  header.insert("x state", Imf::DeepImageStateAttribute(Imf::DIS_TIDY));
  header.insert("x double", Imf::DoubleAttribute(0.1));
  header.insert("x envmap", Imf::EnvmapAttribute(Imf::ENVMAP_CUBE));
  header.insert("x floats", Imf::FloatVectorAttribute({1, 2.5f, 3}));
  header.insert("x keycode", Imf::KeyCodeAttribute(Imf::KeyCode(1, 2, 3, 4, 5, 6, 20)));
  header.insert("x order", Imf::LineOrderAttribute(Imf::RANDOM_Y));
  header.insert("x m33d", Imf::M33dAttribute(matrix3));
  header.insert("x m33f", Imf::M33fAttribute(Imath::M33f(matrix3)));
  header.insert("x m44d", Imf::M44dAttribute(matrix4));
  header.insert("x preview", Imf::PreviewImageAttribute(preview));
  header.insert("x rational", Imf::RationalAttribute(Imf::Rational(24000, 1001)));
  header.insert("x strings", Imf::StringVectorAttribute({"one", "", "three"}));
  header.insert("x no strings", Imf::StringVectorAttribute());
  header.insert("x tiles", Imf::TileDescriptionAttribute(Imf::TileDescription(7, 9, Imf::RIPMAP_LEVELS)));
  header.insert("x time", Imf::TimeCodeAttribute(Imf::TimeCode(1, 2, 3, 4)));
  header.insert("x v2i", Imf::V2iAttribute({1, -2}));
  header.insert("x v2d", Imf::V2dAttribute({1, 0.1}));
  header.insert("x v3i", Imf::V3iAttribute({1, -2, 3}));
  header.insert("x v3f", Imf::V3fAttribute({1, 0.1f, 3}));
  header.insert("x v3d", Imf::V3dAttribute({1, 0.1, 3}));
  DeepImage image = sample();
  image.attributes = Attributes(header);
  const TemporaryFolder folder;
  write(folder / "a.exr", image);
  const DeepImage back = read(folder / "a.exr");
  EXPECT_EQ(difference(image, back), "");
  size_t found = 0;
  for (auto a = header.begin(); a != header.end(); ++a) {
    if (!std::string(a.name()).starts_with("x ")) continue;
    const auto other = back.attributes.header().find(a.name());
    ASSERT_NE(other, back.attributes.header().end()) << a.name();
    EXPECT_STREQ(other.attribute().typeName(), a.attribute().typeName());
    EXPECT_EQ(valueOf(other.attribute()), valueOf(a.attribute())) << a.name();
    ++found;
  }
  EXPECT_EQ(found, 23u);
}

// Whatever the file had that the attributes come from.
TEST(IoWriter, DeclaresTheRowsAsTheyLie) {
  Imf::Header header;
  header.lineOrder() = Imf::DECREASING_Y;
  header.setTileDescription(Imf::TileDescription(7, 9, Imf::MIPMAP_LEVELS));
  header.setType(Imf::TILEDIMAGE);
  header.insert("version", Imf::IntAttribute(3));
  DeepImage image = sample();
  image.attributes = Attributes(header);
  const TemporaryFolder folder;
  write(folder / "a.exr", image);
  EXPECT_EQ(difference(image, readWithOpenExr(folder / "a.exr")), "");
  const Imf::MultiPartInputFile file((folder / "a.exr").c_str());
  EXPECT_EQ(file.header(0).lineOrder(), Imf::INCREASING_Y);
  EXPECT_EQ(file.header(0).type(), Imf::DEEPSCANLINE);
  EXPECT_EQ(file.header(0).version(), 1);
  EXPECT_FALSE(file.header(0).hasTileDescription());
}

TEST(IoWriter, MakesNoTileLargerThanTheWindow) {
  const TemporaryFolder folder;
  WriteOptions options;
  options.tileWidth = 20;
  options.tileHeight = 1 << 30;
  write(folder / "a.exr", sample(), options);
  const PartInfo part = readParts(folder / "a.exr").at(0);
  EXPECT_EQ(part.tileWidth, 20);
  EXPECT_EQ(part.tileHeight, 23);
}

// OpenEXR reads names of 32 letters and more only from files that announce them.
TEST(IoWriter, AnnouncesLongNames) {
  const TemporaryFolder folder;
  for (const size_t length : {31, 32}) {
    const std::string name(length, 'n');
    const DeepImage channel = randomDeep({0, 0, 5, 4}, {0, 0, 5, 4}, {{name, PixelType::Float}});
    DeepImage attribute = sample();
    attribute.attributes.set(name, 7);
    for (const DeepImage* image : {&channel, &std::as_const(attribute)}) {
      write(folder / "a.exr", *image);
      EXPECT_EQ(difference(*image, readWithOpenExr(folder / "a.exr")), "") << length;
      const Imf::MultiPartInputFile file((folder / "a.exr").c_str());
      EXPECT_EQ((file.version() & 0x400) != 0, length > 31);
    }
  }
}

TEST(IoWriter, WhatIsTooLargeForHalfIsTheLargest) {
  const TemporaryFolder folder;
  DeepImage image = randomDeep({0, 0, 6, 1}, {0, 0, 6, 1}, {}, 1, 0);
  for (size_t i = 0; i <= 6; ++i) image.offsets[i] = i;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  std::ranges::copy(std::vector<float>{65504, 65520, -1e30f, kInfinity, -kInfinity, 1},
                    image.add("h", PixelType::Half).values.begin());
  write(folder / "a.exr", image);
  const DeepImage back = read(folder / "a.exr");
  EXPECT_THAT(std::vector<float>(back.get("h").begin(), back.get("h").end()),
              ::testing::ElementsAre(65504, 65504, -65504, kInfinity, -kInfinity, 1));
}

TEST(IoWriter, RefusesAnEmptyWindow) {
  const TemporaryFolder folder;
  for (const Box& window : {Box{3, 4, 3, 8}, Box{3, 4, 8, 4}, Box{8, 4, 3, 8}})
    for (const int tile : {0, 16}) {
      const DeepImage image = randomDeep(window, {0, 0, 8, 8}, {{"A", PixelType::Float}});
      WriteOptions options;
      options.tileWidth = options.tileHeight = tile;
      EXPECT_THAT(errorOf([&] { write(folder / "a.exr", image, options); }),
                  HasSubstr("a.exr: expected pixels, found an empty data window"));
    }
}

TEST(IoWriter, RefusesBandsOfAnotherShape) {
  const TemporaryFolder folder;
  const DeepImage image = sample();
  Writer writer(folder / "a.exr", image, {-7, 5, 30, 20});
  EXPECT_THAT(errorOf([&] { writer.write(image); }),
              HasSubstr("a.exr: expected rows from 5 on, columns -7 to 30; found rows from 5 on, columns -7 to 30"));
  for (const Box& window : {Box{-8, 5, 30, 6}, Box{-7, 5, 31, 6}, Box{-7, 4, 30, 6}}) {
    const DeepImage band = randomDeep(window, {0, 0, 64, 48}, {{"A", PixelType::Half}, {"Z", PixelType::Float}});
    EXPECT_THAT(errorOf([&] { writer.write(band); }), HasSubstr("a.exr: expected rows from 5 on, columns -7 to 30"));
  }
}

TEST(IoWriter, RefusesBandsWithOtherChannels) {
  const TemporaryFolder folder;
  const DeepImage image = sample();
  Writer writer(folder / "a.exr", image, image.dataWindow);
  DeepImage other = rows(image, 5, 8);
  other.add("A", PixelType::Float).values.fill(1);
  EXPECT_THAT(errorOf([&] { writer.write(other); }),
              HasSubstr("a.exr, channel A: expected in every band as in the first"));
  DeepImage fewer = rows(image, 5, 8);
  fewer.find("Z")->values = Buffer<float>(fewer.samples() - 1, 0.0f);
  EXPECT_THAT(
      errorOf([&] { writer.write(fewer); }),
      HasSubstr(fmt::format("a.exr, channel Z: expected {} values, found {}", fewer.samples(), fewer.samples() - 1)));
  writer.write(image);
  writer.finish();
  EXPECT_EQ(difference(image, read(folder / "a.exr")), "");
}

}  // namespace
}  // namespace fathom::deep
