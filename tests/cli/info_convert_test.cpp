// `fathom info` and `fathom convert` as a user runs them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "deep/io.h"
#include "tests/reference/random_deep.h"
#include "tests/reference/run_fathom.h"
#include "tests/reference/temporary_folder.h"

namespace fathom {
namespace {

using deep::PixelType;
using reference::difference;
using ::testing::HasSubstr;

class InfoConvert : public ::testing::Test {
 protected:
  InfoConvert() {
    image_.attributes.set("fathom:spp", 16);
    deep::write(input_, image_);
  }

  Ran convert(const std::string& options) { return runFathom("convert " + input_ + " -o " + output_ + " " + options); }

  TemporaryFolder folder_;
  std::string input_ = folder_ / "in.exr", output_ = folder_ / "out.exr";
  deep::DeepImage image_ = reference::randomDeep(
      {-3, 2, 40, 30}, {0, 0, 64, 48},
      {{"A", PixelType::Half}, {"R", PixelType::Float}, {"Z", PixelType::Float}, {"id", PixelType::Uint}});
};

TEST_F(InfoConvert, ConvertKeepsEveryValue) {
  EXPECT_EQ(convert("--tiles 16x8 --compression rle").status, 0);
  EXPECT_EQ(difference(image_, deep::read(output_)), "");
  const deep::PartInfo part = deep::readParts(output_)[0];
  EXPECT_EQ(part.tileHeight, 8);
  EXPECT_EQ(part.compression, deep::Compression::Rle);
  EXPECT_EQ(part.attributes.getInt("fathom:spp"), 16);
}

TEST_F(InfoConvert, ConvertOntoItself) {
  EXPECT_EQ(runFathom("convert " + input_ + " -o " + input_ + " --tiles 16").status, 0);
  EXPECT_EQ(difference(image_, deep::read(input_)), "");
  EXPECT_TRUE(deep::readParts(input_)[0].tiled);
}

TEST_F(InfoConvert, ConvertTakesChannelsAndTypesByPattern) {
  EXPECT_EQ(convert("--channels '?,id' --half 'R,A' --float A").status, 0);
  const deep::DeepImage back = deep::read(output_);
  ASSERT_EQ(back.channels.size(), 4u);
  EXPECT_EQ(back.find("R")->type, PixelType::Half);
  EXPECT_EQ(back.find("A")->type, PixelType::Half);
  EXPECT_EQ(back.find("Z")->type, PixelType::Float);
  EXPECT_EQ(back.find("id")->type, PixelType::Uint);
}

TEST_F(InfoConvert, ConvertTellsWhatHalfCannotHold) {
  deep::DeepImage image = image_.copy();
  for (float& v : image.get("R")) v = 1e6f;
  deep::write(input_, image);
  const Ran ran = convert("--half R");
  EXPECT_EQ(ran.status, 0);
  EXPECT_THAT(ran.err,
              HasSubstr("channel R: " + std::to_string(image.samples()) + " values are beyond the range of HALF"));
}

TEST_F(InfoConvert, ConvertRefusesWhatItDoesNotFind) {
  EXPECT_THAT(convert("--channels 'Q*'").err, HasSubstr("expected a channel like Q*, found none"));
  EXPECT_THAT(convert("--half id").err, HasSubstr("expected a HALF or FLOAT channel like id, found none"));
  EXPECT_THAT(convert("--tiles 0x4").err, HasSubstr("--tiles: expected a size"));
  EXPECT_EQ(convert("--compression piz").status, 2);
  EXPECT_FALSE(std::filesystem::exists(output_));
}

TEST_F(InfoConvert, InfoAsJson) {
  const Ran ran = runFathom("info --json " + input_);
  EXPECT_EQ(ran.status, 0);
  const auto part = nlohmann::json::parse(ran.out).at(0).at("parts").at(0);
  EXPECT_EQ(part.at("samples").at("total"), image_.samples());
  EXPECT_EQ(part.at("dataWindow").at("x"), -3);
  EXPECT_EQ(part.at("displayWindow").at("width"), 64);
  EXPECT_EQ(part.at("channels").size(), 4u);
  EXPECT_EQ(part.at("attributes").at("fathom:spp"), 16);
  EXPECT_FALSE(part.at("denoise").at("missing").empty());
}

TEST_F(InfoConvert, InfoGoesOnAfterAFileThatFails) {
  const Ran ran = runFathom("info " + (folder_ / "none.exr") + " " + input_);
  EXPECT_EQ(ran.status, 1);
  EXPECT_THAT(ran.err, HasSubstr("none.exr: cannot open"));
  EXPECT_THAT(ran.out, HasSubstr(std::to_string(image_.samples()) + ": "));
}

}  // namespace
}  // namespace fathom
