// Attributes on their way from deep files to flat ones and back.
#include "deep/flat_attributes.h"

#include <OpenEXR/ImfBoxAttribute.h>
#include <OpenEXR/ImfChromaticitiesAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfMatrixAttribute.h>
#include <OpenEXR/ImfStdIO.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>
#include <gtest/gtest.h>

namespace fathom::deep {
namespace {

std::string valueOf(const Imf::Attribute& attribute) {
  Imf::StdOSStream stream;
  attribute.writeValueTo(stream, 2);
  return stream.str();
}

TEST(FlatAttributes, NumbersVectorsMatricesAndTextsGoThereAndBack) {
  Imf::Header header;
  header.insert("x int", Imf::IntAttribute(-3));
  header.insert("x v2i", Imf::V2iAttribute({1, -2}));
  header.insert("x v3i", Imf::V3iAttribute({1, -2, 3}));
  header.insert("x float", Imf::FloatAttribute(0.1f));
  header.insert("x v2f", Imf::V2fAttribute({1, 2.5f}));
  header.insert("x v3f", Imf::V3fAttribute({1, 2.5f, -3}));
  header.insert("x m33f", Imf::M33fAttribute({1, 2, 3, 4, 5, 6, 7, 8, 9}));
  header.insert("x m44f", Imf::M44fAttribute({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16}));
  header.insert("x text", Imf::StringAttribute("made, by hand"));
  header.insert("x digits", Imf::StringAttribute("42"));
  header.insert("chromaticities", Imf::ChromaticitiesAttribute(Imf::Chromaticities({0.1f, 0.2f}, {0.3f, 0.4f})));
  header.insert("x box", Imf::Box2iAttribute({{1, 2}, {3, 4}}));
  const std::map<std::string, std::string> flat = flatAttributes(Attributes(header));
  const std::map<std::string, std::string> expected = {
      {"x int", "-3"},
      {"x v2i", "1, -2"},
      {"x v3i", "1, -2, 3"},
      {"x float", "0.1"},
      {"x v2f", "1.0, 2.5"},
      {"x v3f", "1.0, 2.5, -3.0"},
      {"x m33f", "1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0"},
      {"x m44f", "1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0"},
      {"x text", "made, by hand"},
      {"x digits", "\"42\""}};
  const Attributes back = deepAttributes(flat);
  for (const auto& [name, text] : expected) {
    ASSERT_TRUE(flat.contains(name)) << name;
    EXPECT_EQ(flat.at(name), text) << name;
  }
  for (const auto& [name, text] : flat) {
    const auto found = back.header().find(name);
    ASSERT_NE(found, back.header().end()) << name;
    EXPECT_STREQ(found.attribute().typeName(), header[name.c_str()].typeName()) << name;
    EXPECT_EQ(valueOf(found.attribute()), valueOf(header[name.c_str()])) << name;
  }
  EXPECT_TRUE(flat.contains("chromaticities"));
  EXPECT_FALSE(flat.contains("x box"));
}

TEST(FlatAttributes, WhatDescribesTheFileStaysBehind) {
  Imf::Header header;
  header.setName("a part");
  header.setType("deepscanline");
  header.setVersion(1);
  header.setChunkCount(20);
  header.insert("maxSamplesPerPixel", Imf::IntAttribute(7));
  header.insert("kept", Imf::IntAttribute(7));
  const auto flat = flatAttributes(Attributes(header));
  for (const char* name : {"name", "type", "version", "chunkCount", "maxSamplesPerPixel", "dataWindow", "channels"})
    EXPECT_FALSE(flat.contains(name)) << name;
  EXPECT_EQ(flat.at("kept"), "7");
}

}  // namespace
}  // namespace fathom::deep
