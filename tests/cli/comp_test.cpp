// `fathom comp` as a user runs it, and the bands that a frame goes through in.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "cli/chain_run.h"
#include "deep/clip.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "deep/ops/merge.h"
#include "flat/io.h"
#include "tests/reference/random_ops.h"
#include "tests/reference/run_fathom.h"

namespace fathom::cli {
namespace {

using reference::randomSamples;
using testing::HasSubstr;
using Words = std::vector<std::string>;

class CompCommand : public testing::Test {
 protected:
  void SetUp() override {
    deep::write(folder_ / "hero.exr", randomSamples({.window = {-3, 2, 40, 60}, .seed = 1}));
    deep::write(folder_ / "smoke.exr", randomSamples({.window = {5, -8, 30, 41}, .seed = 2, .volumes = true}),
                {.tileWidth = 8, .tileHeight = 16});
  }
  Ran comp(const std::string& words) const { return runFathom("comp " + words, "cd " + (folder_ / "") + ";"); }

  TemporaryFolder folder_;
};

TEST_F(CompCommand, DoesWhatItsOperationsDo) {
  ASSERT_EQ(comp("hero.exr smoke.exr --merge --clip 2 6 -o deep.exr --flatten -o flat.exr -o flat.png").status, 0);
  std::vector<deep::DeepImage> inputs;
  for (const char* name : {"hero.exr", "smoke.exr"}) inputs.push_back(deep::read(folder_ / name));
  const deep::DeepImage expected = deep::clip(deep::merge(inputs), 2, 6);
  EXPECT_EQ(reference::difference(deep::read(folder_ / "deep.exr"), expected), "");
  const flat::Image flat = flat::read(folder_ / "flat.exr"), flattened = deep::flatten(expected);
  EXPECT_EQ(flat.dataWindow, expected.dataWindow);
  for (const flat::Plane& plane : flattened.planes)
    EXPECT_TRUE(std::ranges::equal(flat.get(plane.name).values, plane.values)) << plane.name;
  EXPECT_TRUE(std::filesystem::exists(folder_ / "flat.png"));
}

TEST_F(CompCommand, GivesTheSameBitsForAnyBandsAndThreads) {
  const Chain chain =
      parseChain(Words{folder_ / "hero.exr", folder_ / "smoke.exr", "--merge", "--dup", "--clip", "2", "6", "-o",
                       folder_ / "clip.exr", "--pop", "--tidy", "--flatten", "-o", folder_ / "flat.exr"});
  runChain(chain, 0, {});
  const std::string deep = textOf(folder_ / "clip.exr"), flat = textOf(folder_ / "flat.exr");
  for (const int rows : {1, 7, 16, 33, 1000}) {
    ChainRunParams params;
    params.bandRows = rows;
    runChain(chain, 0, params);
    EXPECT_TRUE(textOf(folder_ / "clip.exr") == deep) << rows;
    EXPECT_TRUE(textOf(folder_ / "flat.exr") == flat) << rows;
  }
  for (const char* threads : {"1", "2", "5"}) {
    ASSERT_EQ(comp(std::string("hero.exr smoke.exr --merge --clip 2 6 -o clip.exr --threads ") + threads).status, 0);
    EXPECT_TRUE(textOf(folder_ / "clip.exr") == deep) << threads;
  }
}

TEST_F(CompCommand, ASubcommandIsAChainOfOne) {
  ASSERT_EQ(comp("hero.exr --clip 2 6 -o chain.exr").status, 0);
  for (const char* words : {"hero.exr 2 6 -o alone.exr", "-o alone.exr --near 2 --far=6 hero.exr",
                            "hero.exr far=6 near=2 -o alone.exr", "--part 0 hero.exr 2 6 -o alone.exr"}) {
    const Ran ran = runFathom(std::string("clip ") + words, "cd " + (folder_ / "") + ";");
    ASSERT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(textOf(folder_ / "alone.exr") == textOf(folder_ / "chain.exr")) << words;
  }
  EXPECT_EQ(runFathom("clip hero.exr 2 -o alone.exr", "cd " + (folder_ / "") + ";").status, 2);
}

TEST_F(CompCommand, SavesAndReadsChains) {
  ASSERT_EQ(comp("hero.exr --clip 2 6 --save chain.txt -o first.exr").status, 0);
  EXPECT_EQ(textOf(folder_ / "chain.txt"), "hero.exr\n--clip 2 6\n-o first.exr\n");
  std::filesystem::rename(folder_ / "first.exr", folder_ / "expected.exr");
  ASSERT_EQ(comp("--chain chain.txt").status, 0);
  EXPECT_TRUE(textOf(folder_ / "first.exr") == textOf(folder_ / "expected.exr"));
}

TEST_F(CompCommand, SaysWhatIsWrong) {
  const auto check = [&](const std::string& words, int status, const std::string& text) {
    const Ran ran = comp(words + " -o out.exr");
    EXPECT_EQ(ran.status, status) << words;
    EXPECT_THAT(ran.err, HasSubstr(text));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out.exr")) << words;
  };
  check("none.exr", 1, "none.exr: ");
  check("hero.exr --flatten --clip 0 1", 1, "expected a deep image as image 1 of 1, found a flat image");
  check("hero.####.exr", 2, "expected a numbered name");
  check("hero.exr --frames 1-2", 2, "--frames: expected a sequence");
  check("hero.exr --nothing", 2, "--nothing: expected an operation");
  EXPECT_EQ(comp("hero.exr --clip 0 1").status, 2);
  EXPECT_EQ(comp("hero.exr -o out.png").status, 1);
}

TEST_F(CompCommand, AnImageWithoutPixelsIsWrittenWithAnEmptyOne) {
  ASSERT_EQ(comp("hero.exr --crop 900,900,5,5 -o none.exr --flatten -o none.flat.exr").status, 0);
  const deep::DeepImage image = deep::read(folder_ / "none.exr");
  EXPECT_EQ(image.pixels(), 1u);
  EXPECT_EQ(image.samples(), 0u);
  EXPECT_EQ(flat::read(folder_ / "none.flat.exr").get("A").values[0], 0);
}

TEST_F(CompCommand, KeepsFramesThatTheSameChainHasMade) {
  for (const int frame : {1, 2, 3})
    std::filesystem::copy(folder_ / "hero.exr", folder_ / ("in.000" + std::to_string(frame) + ".exr"));
  const std::string chain = "in.####.exr --clip 0 4 -o out.####.exr";
  ASSERT_EQ(comp(chain + " --frames 1-2").status, 0);
  const auto stamp = std::filesystem::last_write_time(folder_ / "out.0001.exr");
  const Ran again = comp(chain + " --stats stats.json");
  EXPECT_EQ(again.status, 0);
  EXPECT_THAT(again.out, HasSubstr("frame 1: is there already"));
  EXPECT_THAT(again.out, HasSubstr("frame 3: done"));
  EXPECT_EQ(std::filesystem::last_write_time(folder_ / "out.0001.exr"), stamp);
  const auto stats = nlohmann::json::parse(textOf(folder_ / "stats.json"));
  EXPECT_EQ(stats["frames"][1]["status"], "kept");
  EXPECT_GT(stats["frames"][2]["counts"]["samples read"], 0);
  EXPECT_THAT(comp("in.####.exr --clip 0 5 -o out.####.exr").out, HasSubstr("frame 1: done"));
}

TEST_F(CompCommand, OneBrokenFrameDoesNotStopTheOthers) {
  std::filesystem::copy(folder_ / "hero.exr", folder_ / "in.0001.exr");
  std::ofstream(folder_ / "in.0002.exr") << "no image";
  std::filesystem::copy(folder_ / "hero.exr", folder_ / "in.0003.exr");
  const Ran ran = comp("in.####.exr --clip 0 4 -o out.####.exr");
  EXPECT_EQ(ran.status, 1);
  EXPECT_THAT(ran.err, HasSubstr("frame 2: in.0002.exr"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out.0003.exr"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out.0002.exr"));
}

}  // namespace
}  // namespace fathom::cli
