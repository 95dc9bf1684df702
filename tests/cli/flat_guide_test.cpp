// --flat-guide: what it takes, what it refuses, and that neither memory nor a second run change what comes out.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"
#include "tests/oidn/installed.h"
#include "tests/reference/rendered_frame.h"
#include "tests/reference/run_fathom.h"
#include "tests/reference/temporary_folder.h"

namespace fathom {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class FlatGuide : public ::testing::Test {
 protected:
  TemporaryFolder folder;
  const reference::RenderedFrame frame = reference::renderFrame({.width = 64, .height = 160});

  void SetUp() override { deep::write(folder / "in.exr", frame.noisy); }
  Ran run(const std::string& more, const std::string& out = "out.exr") const {
    return runFathom("denoise in.exr -o " + out + " --overwrite " + more,
                     "cd '" + folder.path() + "'; FATHOM_MODELS=/nowhere");
  }
  std::vector<float> red(const std::string& more) const {
    const Ran done = run(more);
    EXPECT_EQ(done.status, 0) << done.err;
    const deep::DeepImage image = deep::read(folder / "out.exr");
    const auto values = image.get("R");
    return {values.begin(), values.end()};
  }
  void writeGuide(const std::string& name, int cut, bool green = true) const {
    flat::Image guide = deep::flatten(frame.truth);
    if (!green) std::erase_if(guide.planes, [](const flat::Plane& plane) { return plane.name == "G"; });
    Box box = guide.dataWindow;
    box.y1 -= cut;
    flat::write(folder / name, flat::crop(guide, box));
  }
};

TEST_F(FlatGuide, WithoutNetworksAutoIsOurOwnFilterForTheBestAndElseNone) {
  const std::vector<float> own = red("--quality best --flat-guide nlm");
  EXPECT_EQ(red("--quality best"), own);
  EXPECT_NE(red("--quality best --flat-guide none"), own);
  for (const std::string quality : {"fast", "balanced"})
    EXPECT_EQ(red("--quality " + quality), red("--quality " + quality + " --flat-guide none"));
}

TEST_F(FlatGuide, AFileGuides) {
  writeGuide("truth.exr", 0);
  const auto errorOf = [&](const std::vector<float>& red) {
    deep::DeepImage image = frame.truth.copy();
    std::copy(red.begin(), red.end(), image.get("R").begin());
    const flat::Image a = deep::flatten(image), b = deep::flatten(frame.truth);
    double sum = 0;
    for (size_t i = 0; i < a.get("R").values.size(); ++i)
      sum += std::pow(double(a.get("R").values[i] - b.get("R").values[i]), 2);
    return sum;
  };
  EXPECT_LT(errorOf(red("--flat-guide truth.exr")), 0.5 * errorOf(red("--flat-guide none")));
}

TEST_F(FlatGuide, AFileThatDoesNotFitIsOneLine) {
  writeGuide("short.exr", 3);
  const Ran small = run("--flat-guide short.exr");
  EXPECT_EQ(small.status, 1);
  EXPECT_THAT(small.err,
              HasSubstr("short.exr: expected the data window of the deep frame, (-5, -7) to (58, 152), found "
                        "(-5, -7) to (58, 149)"));
  writeGuide("colourless.exr", 0, false);
  EXPECT_THAT(run("--flat-guide colourless.exr").err, HasSubstr("colourless.exr, channel G: expected in a guide"));
  EXPECT_EQ(run("--flat-guide nowhere.exr").status, 1);
  EXPECT_FALSE(std::filesystem::exists(folder / "out.exr"));
}

TEST_F(FlatGuide, ANewGuideMakesTheFrameAnew) {
  writeGuide("guide.exr", 0);
  const std::vector<float> first = red("--flat-guide guide.exr");
  EXPECT_THAT(run("--flat-guide guide.exr").out, HasSubstr("done before"));
  flat::Image other = flat::read(folder / "guide.exr");
  for (float& v : other.planes[0].values) v *= 2;
  flat::write(folder / "guide.exr", other);
  EXPECT_NE(red("--flat-guide guide.exr"), first);
}

TEST_F(FlatGuide, BandsGiveTheSameBytes) {
  writeGuide("guide.exr", 0);
  for (const auto& [guide, memory] : {std::pair("nlm", "16M"), std::pair("guide.exr", "24M")}) {
    ASSERT_EQ(run(fmt::format("--flat-guide {}", guide), "whole.exr").status, 0);
    const Ran bands = run(fmt::format("--flat-guide {} --memory {} --stats stats.json", guide, memory), "bands.exr");
    ASSERT_EQ(bands.status, 0) << bands.err;
    EXPECT_THAT(textOf(folder / "stats.json"), Not(HasSubstr("\"bands\": 1,"))) << "the frame was not cut";
    EXPECT_EQ(textOf(folder / "whole.exr"), textOf(folder / "bands.exr")) << guide;
  }
}

TEST_F(FlatGuide, TooLittleMemoryForAWholeFrameIsOneLine) {
  writeGuide("guide.exr", 0);
  const Ran done = run("--flat-guide guide.exr --memory 12M");
  EXPECT_EQ(done.status, 1);
  EXPECT_THAT(done.err, HasSubstr("MB of memory, for the guide of the whole frame and a row"));
  EXPECT_THAT(done.err, HasSubstr("found a limit of 12 MB"));
}

TEST_F(FlatGuide, NeedsToKnowTheNoise) {
  deep::DeepImage bare = frame.noisy.copy();
  std::erase_if(bare.channels, [](const deep::Channel& channel) {
    return channel.name.starts_with("half") || channel.name.starts_with("variance.");
  });
  deep::write(folder / "in.exr", bare);
  EXPECT_EQ(run("").status, 0);
  const Ran asked = run("--flat-guide nlm");
  EXPECT_EQ(asked.status, 1);
  EXPECT_THAT(asked.err,
              HasSubstr("in.exr: expected variance.* or half0.* and half1.* for --flat-guide, found neither"));
}

TEST_F(FlatGuide, WithoutTheLibraryALineSaysSo) {
  const Ran done = run("--flat-guide oidn --oidn-library /nowhere");
  EXPECT_EQ(done.status, 1);
  EXPECT_THAT(done.err, HasSubstr("/nowhere"));
}

class WithOidnGuide : public reference::WithOidnInstalled {
 protected:
  TemporaryFolder folder;
  const reference::RenderedFrame frame = reference::renderFrame({.width = 64, .height = 160});

  Ran run(const std::string& more, const std::string& out) const {
    deep::write(folder / "in.exr", frame.noisy);
    return runFathom("denoise in.exr -o " + out + " --overwrite --oidn-library '" + reference::kOidn + "' " + more,
                     "cd '" + folder.path() + "'; ");
  }
};

TEST_F(WithOidnGuide, BandsAndThreadsGiveTheSameBytes) {
  ASSERT_EQ(run("--flat-guide oidn", "whole.exr").status, 0);
  const Ran bands = run("--base oidn --memory 42M --stats stats.json --threads 1", "bands.exr");
  ASSERT_EQ(bands.status, 0) << bands.err;
  EXPECT_THAT(bands.err, HasSubstr("bins are guided by oidn"));
  EXPECT_THAT(textOf(folder / "stats.json"), Not(HasSubstr("\"bands\": 1,"))) << "the frame was not cut";
  EXPECT_EQ(textOf(folder / "whole.exr"), textOf(folder / "bands.exr"));
}

TEST_F(WithOidnGuide, AutoDoesWithoutWhereTheMemoryIsShort) {
  ASSERT_EQ(run("--flat-guide none", "none.exr").status, 0);
  const Ran small = run("--memory 16M", "small.exr");
  ASSERT_EQ(small.status, 0) << small.err;
  EXPECT_THAT(small.err, HasSubstr("in.exr: no guide by Open Image Denoise"));
  EXPECT_EQ(textOf(folder / "none.exr"), textOf(folder / "small.exr"));
  EXPECT_THAT(run("", "large.exr").err, HasSubstr("bins are guided by oidn"));
}

}  // namespace
}  // namespace fathom
