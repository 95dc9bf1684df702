// Each entry of the table for colour and size, as a chain: the same bits in bands, and what it says afterwards.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"
#include "tests/reference/random_ops.h"
#include "tests/reference/run_chain.h"

namespace fathom::cli {
namespace {

using reference::randomSamples;
using reference::runChainIn;
using testing::HasSubstr;
using Words = std::vector<std::string>;

class ColourOperations : public testing::Test {
 protected:
  void SetUp() override {
    deep::DeepImage hero = randomSamples({.window = {-3, 2, 40, 60}, .seed = 1, .volumes = true, .most = 20});
    for (const char* name : {"variance.R", "diffuse.R"}) hero.add(name, deep::PixelType::Float).values.fill(0.1f);
    deep::write(folder_ / "hero.exr", hero);
    flat::write(folder_ / "flat.exr", deep::flatten(randomSamples({.window = {-8, 5, 30, 70}, .seed = 2})));
  }
  ChainRunReport run(const Words& words, int bandRows) const { return runChainIn(folder_, words, bandRows); }

  TemporaryFolder folder_;
};

TEST_F(ColourOperations, GiveTheSameBitsAndSayTheSameForAnyBands) {
  const std::vector<Words> chains = {
      {"hero.exr", "--grade", "gain=2,1,0.5", "gamma=1.5", "saturation=0.5", "near=2", "nearsoft=1", "far=6"},
      {"hero.exr", "--expression", "set=R = R*0.5 + y*0.001 + i; B = x/n"},
      {"hero.exr", "flat.exr", "--recolour"},
      {"hero.exr", "flat.exr", "--recolour", "matte"},
      {"hero.exr", "--compress", "error=0.05"},
      {"hero.exr", "--compress", "error=0.05", "--tidy", "--clip", "2", "3"}};
  for (const Words& chain : chains) {
    const ChainRunReport report = run(chain, 1000);
    const std::string whole = textOf(folder_ / "out.exr");
    for (const int rows : {1, 7, 33}) {
      EXPECT_EQ(run(chain, rows).notes, report.notes) << testing::PrintToString(chain);
      EXPECT_TRUE(textOf(folder_ / "out.exr") == whole) << testing::PrintToString(chain);
    }
  }
}

TEST_F(ColourOperations, SayWhatTheyDid) {
  EXPECT_THAT(run({"hero.exr", "--grade", "gain=2"}, 10).notes,
              testing::ElementsAre("grade: dropped, since they no longer describe the image: variance.R",
                                   HasSubstr("were not graded alike")));
  EXPECT_THAT(run({"hero.exr", "--expression", "set=mask = Z < 3"}, 10).notes,
              testing::ElementsAre("expression: new channels: mask"));
  EXPECT_THAT(run({"hero.exr", "flat.exr", "--recolour"}, 10).notes, testing::Contains(HasSubstr("no deep sample")));
  const deep::DeepImage hero = deep::read(folder_ / "hero.exr");
  EXPECT_THAT(run({"hero.exr", "--compress", "error=0.05"}, 10).notes,
              testing::Contains(HasSubstr(fmt::format(" samples of {} (", hero.samples()))));
}

TEST_F(ColourOperations, SayWhatIsWrong) {
  for (const Words& chain : std::vector<Words>{{"hero.exr", "--grade", "gain=1,2"},
                                               {"hero.exr", "--grade", "gamma=0"},
                                               {"hero.exr", "--grade", "channels=specular"},
                                               {"hero.exr", "--expression", "set=R = R*"},
                                               {"hero.exr", "--expression", "set=R = depth"},
                                               {"hero.exr", "flat.exr", "--recolour", "channels=diffuse"},
                                               {"hero.exr", "--compress", "error=0"}})
    EXPECT_THROW(run(chain, 10), Error) << testing::PrintToString(chain);
}

}  // namespace
}  // namespace fathom::cli
