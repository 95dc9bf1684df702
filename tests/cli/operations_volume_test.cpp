// Each entry of the table for volumes and what hides what, as a chain: the same bits in bands, and as the function that
// it stands for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "deep/ops/holdout.h"
#include "flat/io.h"
#include "tests/reference/random_ops.h"
#include "tests/reference/run_chain.h"

namespace fathom::cli {
namespace {

using reference::bytesOfChain;
using reference::randomSamples;
using Words = std::vector<std::string>;

class VolumeOperations : public testing::Test {
 protected:
  void SetUp() override {
    hero_ = randomSamples({.window = {-3, 2, 40, 60}, .seed = 1, .volumes = true});
    hero_.add("variance.R", deep::PixelType::Float).values.fill(0.1f);
    hero_.attributes.set("fieldOfView", 50.0f);
    hero_.attributes.set("worldToCamera", std::array<float, 16>{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -2, 0, 1});
    smoke_ = randomSamples({.window = {5, -8, 30, 41}, .seed = 2, .volumes = true});
    deep::write(folder_ / "hero.exr", hero_);
    deep::write(folder_ / "smoke.exr", smoke_);
    flat::write(folder_ / "flat.exr", deep::flatten(smoke_));
  }
  std::string bytesOf(const Words& words, int bandRows) const { return bytesOfChain(folder_, words, bandRows); }

  TemporaryFolder folder_;
  deep::DeepImage hero_, smoke_;
};

TEST_F(VolumeOperations, GiveTheSameBitsForAnyBands) {
  const std::vector<Words> chains = {{"hero.exr", "smoke.exr", "--holdout"},
                                     {"hero.exr", "smoke.exr", "--holdout", "hard", "opaque=0.7"},
                                     {"smoke.exr", "hero.exr", "--holdoutmatte"},
                                     {"hero.exr", "smoke.exr", "--plus"},
                                     {"hero.exr", "flat.exr", "--clipmap"},
                                     {"hero.exr", "flat.exr", "--clipmap", "keep=behind", "channel=G"},
                                     {"hero.exr", "smoke.exr", "flat.exr", "--keymix"},
                                     {"hero.exr", "smoke.exr", "flat.exr", "--keymix", "channel=G"},
                                     {"hero.exr", "--clip", "2", "3"},
                                     {"hero.exr", "--clip", "0", "inf"},
                                     {"flat.exr", "--deepen"},
                                     {"flat.exr", "--deepen", "z=3", "thickness=2", "alpha=extinction"},
                                     {"hero.exr", "--fog", "0.2", "5"},
                                     {"hero.exr", "--fog", "0.2", "5", "near=1", "colour=1,0.5,0.2", "apply"},
                                     {"hero.exr", "--fog", "0.5", "6", "height=1.5", "falloff=0.4", "slabs=4"},
                                     {"hero.exr", "--fog", "0.5", "6", "height=1.5", "up=z", "apply"}};
  for (const Words& chain : chains) {
    const std::string whole = bytesOf(chain, 1000);
    for (const int rows : {1, 7, 33}) EXPECT_TRUE(bytesOf(chain, rows) == whole) << testing::PrintToString(chain);
  }
}

TEST_F(VolumeOperations, ReadAndWriteWhatTheFunctionGives) {
  bytesOf({"hero.exr", "smoke.exr", "--holdout"}, 10);
  const deep::DeepImage held = deep::read(folder_ / "out.exr");
  EXPECT_EQ(reference::difference(held, deep::holdout(hero_.copy(), smoke_)), "");
}

TEST_F(VolumeOperations, ClipKeepsStatisticsWhereTheFrameHasNothingOnAPlane) {
  bytesOf({"hero.exr", "--clip", "0", "inf"}, 10);
  EXPECT_TRUE(deep::read(folder_ / "out.exr").find("variance.R"));
  bytesOf({"hero.exr", "--clip", "2", "3"}, 10);
  EXPECT_FALSE(deep::read(folder_ / "out.exr").find("variance.R"));
}

TEST_F(VolumeOperations, SayWhatIsWrong) {
  for (const Words& chain : std::vector<Words>{{"hero.exr", "smoke.exr", "--holdout", "hard", "opaque=0"},
                                               {"hero.exr", "flat.exr", "--clipmap", "channel=depth"},
                                               {"flat.exr", "--deepen", "channel=depth"},
                                               {"flat.exr", "--deepen", "alpha=extinction"},
                                               {"hero.exr", "--fog", "0.2", "inf"},
                                               {"hero.exr", "--fog", "0.2", "5", "colour=1,2"},
                                               {"smoke.exr", "--fog", "0.2", "5", "height=1"}})
    EXPECT_THROW(bytesOf(chain, 10), Error) << testing::PrintToString(chain);
}

}  // namespace
}  // namespace fathom::cli
