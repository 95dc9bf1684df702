// `fathom tidy`, `flatten` and `cluster` as a user runs them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "cli/bands.h"
#include "deep/flatten.h"
#include "deep/tidy.h"
#include "flat/io.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/run_fathom.h"

namespace fathom::cli {
namespace {

using deep::DeepImage;
using reference::makeDeep;
using reference::Pixels;
using ::testing::HasSubstr;

// 12 x 12 pixels of volumes and points that overlap.
DeepImage untidy() {
  std::mt19937 random(1);
  std::uniform_int_distribution<int> depth(1, 9);
  std::uniform_real_distribution<float> uniform(0, 1);
  Pixels pixels(144);
  for (size_t p = 0; p < pixels.size(); ++p)
    for (size_t i = 0; i < p % 7; ++i)
      pixels[p].push_back({float(depth(random)), float(depth(random)), uniform(random), uniform(random), uint32_t(i)});
  return makeDeep(pixels, 12);
}

// Four camera samples per pixel on a surface and four behind it.
DeepImage cameraSamples() {
  std::vector<reference::Sample> samples;
  for (int k = 0; k < 8; ++k) {
    const float z = (k < 4 ? 1.0f : 5.0f) + 0.0001f * float(k), alpha = float(1.0 / (8 - k));
    samples.push_back({z, z, alpha, float(k) * alpha, 3});
  }
  return makeDeep(Pixels(20, samples), 5, false);
}

deep::WriteOptions stored(deep::Compression compression, int tileWidth, int tileHeight) {
  deep::WriteOptions options;
  options.compression = compression;
  options.tileWidth = tileWidth;
  options.tileHeight = tileHeight;
  return options;
}

size_t lines(const std::string& text) {
  return size_t(std::count(text.begin(), text.end(), '\n'));
}

TEST(TidyCommand, TwiceIsOnce) {
  const TemporaryFolder folder;
  deep::write(folder / "in.exr", untidy());
  const Ran first = runFathom("tidy " + (folder / "in.exr") + " -o " + (folder / "once.exr"));
  ASSERT_EQ(first.status, 0) << first.err;
  ASSERT_EQ(runFathom("tidy " + (folder / "once.exr") + " -o " + (folder / "twice.exr")).status, 0);
  EXPECT_EQ(textOf(folder / "once.exr"), textOf(folder / "twice.exr"));
  EXPECT_TRUE(deep::isTidy(deep::read(folder / "once.exr")));
}

TEST(TidyCommand, TellsWhatItDropped) {
  const TemporaryFolder folder;
  DeepImage image = untidy();
  image.add("samples", deep::PixelType::Half).values.fill(1);
  image.add("variance.R", deep::PixelType::Float).values.fill(1);
  deep::write(folder / "in.exr", image);
  EXPECT_THAT(runFathom("tidy " + (folder / "in.exr") + " -o " + (folder / "out.exr")).out,
              HasSubstr("samples variance.R"));
  EXPECT_FALSE(deep::read(folder / "out.exr").find("samples"));
}

TEST(TidyCommand, KeepsTheWayOfStoring) {
  const TemporaryFolder folder;
  deep::write(folder / "in.exr", untidy(), stored(deep::Compression::Rle, 5, 4));
  ASSERT_EQ(runFathom("tidy " + (folder / "in.exr") + " -o " + (folder / "out.exr")).status, 0);
  const deep::PartInfo part = deep::readParts(folder / "out.exr")[0];
  EXPECT_TRUE(part.tiled);
  EXPECT_EQ(part.tileHeight, 4);
  EXPECT_EQ(part.compression, deep::Compression::Rle);
}

TEST(TidyCommand, InPlace) {
  const TemporaryFolder folder;
  deep::write(folder / "a.exr", untidy());
  const Ran ran = runFathom("tidy " + (folder / "a.exr") + " -o " + (folder / "a.exr"));
  EXPECT_EQ(ran.status, 0) << ran.err;
  EXPECT_TRUE(deep::isTidy(deep::read(folder / "a.exr")));
}

TEST(FlattenCommand, WritesTheFlatImage) {
  const TemporaryFolder folder;
  const DeepImage image = untidy();
  deep::write(folder / "in.exr", image);
  ASSERT_EQ(runFathom("flatten " + (folder / "in.exr") + " -o " + (folder / "out.exr")).status, 0);
  const flat::Image found = flat::read(folder / "out.exr"), expected = deep::flatten(image);
  EXPECT_EQ(found.dataWindow, expected.dataWindow);
  EXPECT_EQ(found.displayWindow, expected.displayWindow);
  for (const char* name : {"R", "B", "A", "Z"})
    for (size_t p = 0; p < image.pixels(); ++p)
      EXPECT_EQ(found.get(name).values[p], expected.get(name).values[p]) << name;
}

TEST(FlattenCommand, AMissingChannelIsOneLine) {
  const TemporaryFolder folder;
  DeepImage image = untidy();
  image.erase("A");
  deep::write(folder / "in.exr", image);
  const Ran ran = runFathom("flatten " + (folder / "in.exr") + " -o " + (folder / "out.exr"));
  EXPECT_EQ(ran.status, 1);
  EXPECT_EQ(lines(ran.err), 1u);
  EXPECT_THAT(ran.err, HasSubstr((folder / "in.exr") + ": flatten: channel A"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out.exr"));
}

TEST(ClusterCommand, GathersSamplesIntoBins) {
  const TemporaryFolder folder;
  deep::write(folder / "in.exr", cameraSamples());
  const Ran ran = runFathom("cluster --ppu-scale 100 " + (folder / "in.exr") + " -o " + (folder / "out.exr"));
  ASSERT_EQ(ran.status, 0) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("40 bins of 160 samples, 2.00 bins per pixel"));
  const DeepImage bins = deep::read(folder / "out.exr");
  EXPECT_EQ(bins.get("A")[0], 0.5f);
  EXPECT_EQ(bins.get("A")[1], 1);
  EXPECT_EQ(bins.get("R")[1], 5.5f);
  EXPECT_EQ(bins.get("samples")[0], 4);
  EXPECT_EQ(bins.attributes.getFloat("fathom:ppuScale"), 100.0f);
  // One bin where depth does not matter, and every sample for itself where it does.
  EXPECT_EQ(runFathom("cluster --ppu-scale 1e-4 " + (folder / "in.exr") + " -o " + (folder / "one.exr")).status, 0);
  EXPECT_EQ(deep::read(folder / "one.exr").samples(), 20u);
  EXPECT_EQ(runFathom("cluster --ppu-scale 1e6 --E 0 " + (folder / "in.exr") + " -o " + (folder / "all.exr")).status,
            0);
  EXPECT_EQ(deep::read(folder / "all.exr").samples(), 160u);
}

TEST(FlattenCommand, CountsValuesThatAreNotFinite) {
  const TemporaryFolder folder;
  DeepImage image = untidy();
  const size_t last = image.samples() - 1;
  image.get("R")[0] = image.get("B")[0] = image.get("B")[last] = std::numeric_limits<float>::quiet_NaN();
  deep::write(folder / "in.exr", image);
  EXPECT_THAT(runFathom("flatten " + (folder / "in.exr") + " -o " + (folder / "out.exr")).out, HasSubstr(" 2 samples"));
  EXPECT_THAT(runFathom("cluster --ppu-scale 9 " + (folder / "in.exr") + " -o " + (folder / "bins.exr")).out,
              HasSubstr(" 2 samples"));
}

TEST(ClusterCommand, SaysHowToGiveTheScale) {
  const TemporaryFolder folder;
  deep::write(folder / "in.exr", cameraSamples());
  const Ran ran = runFathom("cluster " + (folder / "in.exr") + " -o " + (folder / "out.exr"));
  EXPECT_EQ(ran.status, 1);
  EXPECT_EQ(lines(ran.err), 1u);
  EXPECT_THAT(ran.err, HasSubstr("in.exr: depth scale"));
  EXPECT_THAT(ran.err, HasSubstr("--ppu-scale"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out.exr"));
}

TEST(ClusterCommand, BinsOfAPrepass) {
  const TemporaryFolder folder;
  deep::write(folder / "in.exr", cameraSamples());
  DeepImage prepass = makeDeep(Pixels(20, {{2, 2}, {6, 6}}), 5, false);
  for (const char* name : {"R", "B", "A", "id"}) prepass.erase(name);
  prepass.dataWindow = {3, 0, 8, 4};  // two rows less above, two more below
  deep::write(folder / "prepass.exr", prepass);
  const std::string bins = "cluster --bins " + (folder / "prepass.exr") + " " + (folder / "in.exr");
  const Ran ran = runFathom(bins + " -o " + (folder / "out.exr"));
  ASSERT_EQ(ran.status, 0) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("80 samples lie in pixels without bins"));
  const DeepImage found = deep::read(folder / "out.exr");
  EXPECT_EQ(found.samples(), 20u);
  EXPECT_EQ(found.count(0), 0u);
  EXPECT_EQ(found.get("Z")[1], 6);
  EXPECT_EQ(found.get("A")[0], 0.5f);
  EXPECT_EQ(runFathom(bins + " --ppu-scale 3 -o " + (folder / "no.exr")).status, 2);
}

TEST(Bands, CoverTheWindowOnce) {
  const TemporaryFolder folder;
  const DeepImage image = untidy();
  for (const int tile : {0, 5}) {
    deep::write(folder / "in.exr", image, stored(deep::Compression::Zips, tile, tile));
    deep::Reader reader(folder / "in.exr");
    for (const size_t bytes : {size_t(1), size_t(2000), size_t(1) << 30}) {
      std::vector<float> colours;
      int bands = 0, y = image.dataWindow.y0;
      forEachBand(
          reader,
          [&](const DeepImage& band) {
            EXPECT_EQ(band.dataWindow.y0, y);
            y = band.dataWindow.y1;
            ++bands;
            colours.insert(colours.end(), band.get("R").begin(), band.get("R").end());
          },
          bytes);
      EXPECT_EQ(y, image.dataWindow.y1);
      EXPECT_TRUE(std::equal(colours.begin(), colours.end(), image.get("R").begin(), image.get("R").end()));
      EXPECT_GE(bands, bytes > 2000 ? 1 : bytes > 1 ? 2 : tile ? 3 : 12);
      EXPECT_LE(bands, bytes > 2000 ? 1 : 12);
    }
  }
}

}  // namespace
}  // namespace fathom::cli
