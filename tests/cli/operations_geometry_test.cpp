// Each entry of the table that moves pixels or chooses channels and samples, as a chain: the same bits in bands, and as
// the function that it stands for.
#include <gtest/gtest.h>

#include "base/error.h"
#include "deep/io.h"
#include "deep/ops/insert.h"
#include "deep/ops/resize.h"
#include "tests/reference/random_ops.h"
#include "tests/reference/run_chain.h"

namespace fathom::cli {
namespace {

using reference::bytesOfChain;
using reference::randomSamples;
using Words = std::vector<std::string>;

class GeometryOperations : public testing::Test {
 protected:
  void SetUp() override {
    hero_ = randomSamples({.window = {-3, 2, 40, 60}, .seed = 1, .volumes = true});
    hero_.displayWindow = {0, 0, 41, 57};
    hero_.add("variance.R", deep::PixelType::Float).values.fill(0.1f);
    smoke_ = randomSamples({.window = {5, -8, 30, 41}, .seed = 2, .volumes = true});
    deep::write(folder_ / "hero.exr", hero_);
    deep::write(folder_ / "smoke.exr", smoke_);
  }
  std::string bytesOf(const Words& words, int bandRows) const { return bytesOfChain(folder_, words, bandRows); }

  TemporaryFolder folder_;
  deep::DeepImage hero_, smoke_;
};

TEST_F(GeometryOperations, GiveTheSameBitsForAnyBands) {
  const std::vector<Words> chains = {{"hero.exr", "--transform", "x=3", "y=-7"},
                                     {"hero.exr", "--transform", "x=0.5", "y=-2.25", "z=1", "zscale=2"},
                                     {"hero.exr", "--transform", "y=3.5", "scale=0.3"},
                                     {"hero.exr", "--transform", "scale=2", "--flatten"},
                                     {"hero.exr", "smoke.exr", "--insert", "z=0.5", "y=60"},
                                     {"hero.exr", "smoke.exr", "--insert", "x=-1.5", "y=9.75", "scale=1.7"},
                                     {"hero.exr", "--resize", "factor=0.37"},
                                     {"hero.exr", "--resize", "factor=2"},
                                     {"hero.exr", "--resize", "size=70,31", "filter=bilinear"},
                                     {"hero.exr", "--resize", "size=7"},
                                     {"hero.exr", "--reformat", "-5,10,20,80"},
                                     {"hero.exr", "--reformat", "-5,10,20,30", "place=corner", "crop"},
                                     {"hero.exr", "--shuffle", "map=R:B,B:R,copy:id", "drop=variance.*", "set=mask:1"},
                                     {"hero.exr", "--limit", "2"}};
  for (const Words& chain : chains) {
    const std::string whole = bytesOf(chain, 1000);
    for (const int rows : {1, 7, 33}) EXPECT_TRUE(bytesOf(chain, rows) == whole) << testing::PrintToString(chain);
  }
}

TEST_F(GeometryOperations, WriteWhatTheFunctionGives) {
  bytesOf({"hero.exr", "smoke.exr", "--insert", "z=0.5", "x=2.5", "tolerance=0.01"}, 10);
  const deep::DeepImage inserted = deep::insert(hero_.copy(), smoke_.copy(), {.x = 2.5, .z = 0.5, .tolerance = 0.01});
  EXPECT_EQ(reference::difference(deep::read(folder_ / "out.exr"), inserted), "");
  bytesOf({"hero.exr", "--resize", "size=20"}, 10);
  EXPECT_EQ(reference::difference(deep::read(folder_ / "out.exr"), deep::resize(hero_.copy(), 20, 28)), "");
}

TEST_F(GeometryOperations, SayWhatIsWrong) {
  for (const Words& chain : std::vector<Words>{{"hero.exr", "--transform", "scale=0"},
                                               {"hero.exr", "--transform", "zscale=-1"},
                                               {"hero.exr", "--transform", "x=inf"},
                                               {"hero.exr", "--resize"},
                                               {"hero.exr", "--resize", "factor=0.5", "size=4"},
                                               {"hero.exr", "--resize", "factor=0"},
                                               {"hero.exr", "--resize", "factor=inf"},
                                               {"hero.exr", "--resize", "size=1,2,3"},
                                               {"hero.exr", "--resize", "size=0.5"},
                                               {"hero.exr", "--reformat", "0,0,0,5"},
                                               {"hero.exr", "--shuffle", "map=R"},
                                               {"hero.exr", "--shuffle", "map=R:none"},
                                               {"hero.exr", "--shuffle", "set=R:red"},
                                               {"hero.exr", "--limit", "0"}})
    EXPECT_THROW(bytesOf(chain, 10), Error) << testing::PrintToString(chain);
}

}  // namespace
}  // namespace fathom::cli
