// `fathom compare` as a user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "flat/io.h"
#include "tests/reference/run_fathom.h"

namespace fathom {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

const std::string kDeep = FATHOM_DEMO "/sequence.0002.deep.exr",
                  kDeepReference = FATHOM_DEMO "/sequence.0002.deepref.exr",
                  kReference = FATHOM_DEMO "/sequence.0002.ref.exr";

json jsonOf(const std::string& arguments) {
  const Ran ran = runFathom("compare --json " + arguments);
  EXPECT_EQ(ran.status, 0) << ran.err;
  return json::parse(ran.out, nullptr, false);
}

flat::Image makeFlat(float value, int width = 8) {
  flat::Image image{{0, 0, width, 8}, {0, 0, width, 8}, {}, {}};
  for (const char* name : {"R", "G", "B"}) image.add(name, value);
  return image;
}

TEST(CompareCommand, AnImageAgainstItself) {
  const json report = jsonOf(kDeep + " " + kDeep + " --clip 7");
  const json& frame = report["frames"][0];
  EXPECT_EQ(frame["flattened"]["relMSE"], 0);
  EXPECT_TRUE(frame["flattened"]["PSNR"].is_null());
  EXPECT_EQ(frame["flattened"]["SSIM"], 1);
  EXPECT_EQ(frame["bins"]["relMSE"], 0);
  EXPECT_EQ(frame["clips"][0]["depth"], 7);
  EXPECT_EQ(frame["clips"][0]["front"]["MSE"], 0);
  EXPECT_EQ(report["mean"]["flattened"]["relMSE"], 0);
  EXPECT_TRUE(report["mean"]["flattened"]["PSNR"].is_null());
  EXPECT_FALSE(report.contains("flicker"));
}

TEST(CompareCommand, CorrectingSubtractsTheReferencesOwnError) {
  const json plain = jsonOf(kDeep + " " + kReference)["mean"]["flattened"];
  const json corrected = jsonOf(kDeep + " " + kReference + " --correct")["mean"]["flattened"];
  const double own = plain["ownRelMSE"];
  EXPECT_GT(own, 0.001);
  EXPECT_NEAR(corrected["relMSE"].get<double>(), plain["relMSE"].get<double>() - own, 1e-9);
}

// A deep reference has no variances: the noisy frame's, and how many samples each bin of both has, stand for them.
TEST(CompareCommand, TheNoisyFrameTellsADeepReferencesOwnError) {
  const json plain = jsonOf(kDeep + " " + kDeepReference + " --clip median")["mean"];
  const json corrected = jsonOf(kDeep + " " + kDeepReference + " --clip median --correct --noisy " + kDeep)["mean"];
  const double noisy = plain["bins"]["relMSE"], without = corrected["bins"]["relMSE"];
  // 32 samples against 512: the reference has about a sixteenth of the noise, and the frame the rest.
  EXPECT_NEAR((noisy - without) / without, 1.0 / 16, 0.02);
  EXPECT_LT(corrected["clips"][0]["front"]["relMSE"].get<double>(), plain["clips"][0]["front"]["relMSE"].get<double>());
  EXPECT_EQ(runFathom("compare " + kDeep + " " + kDeepReference + " --correct --noisy " + kReference).status, 1);
}

TEST(CompareCommand, ATableForPeople) {
  const Ran ran = runFathom("compare " + kDeep + " " + kDeepReference + " --clip median,3");
  EXPECT_EQ(ran.status, 0);
  EXPECT_EQ(ran.err, "");
  for (const char* text : {"relMSE", "flattened", "per bin", "in front of", "behind", "behind 3"})
    EXPECT_THAT(ran.out, HasSubstr(text));
}

TEST(CompareCommand, ASequenceHasAMeanAndFlicker) {
  const std::string pattern = FATHOM_DEMO "/sequence.####";
  const json report = jsonOf(pattern + ".deep.exr " + pattern + ".ref.exr --correct --frames 1-3");
  ASSERT_EQ(report["frames"].size(), 3u);
  double sum = 0;
  for (const json& frame : report["frames"]) sum += frame["flattened"]["relMSE"].get<double>();
  EXPECT_NEAR(report["mean"]["flattened"]["relMSE"].get<double>(), sum / 3, 1e-12);
  // Frames of independent noise.
  EXPECT_NEAR(report["flicker"].get<double>() / (2 * sum / 3), 1, 0.1);
  EXPECT_THAT(runFathom("compare " + pattern + ".deep.exr " + pattern + ".ref.exr").out, HasSubstr("Mean of 3 frames"));
}

TEST(CompareCommand, AHeatmapShowsTheFrameAndItsScale) {
  const TemporaryFolder folder;
  ASSERT_EQ(runFathom("compare " + kDeep + " " + kReference + " --heatmap " + (folder / "heat.png")).status, 0);
  const flat::Image frame = flat::read(kReference), heat = flat::read(folder / "heat.png");
  EXPECT_EQ(heat.dataWindow.width(), frame.dataWindow.width());
  EXPECT_GT(heat.dataWindow.height(), frame.dataWindow.height());
}

TEST(CompareCommand, EveryMistakeIsOneLine) {
  const TemporaryFolder folder;
  flat::write(folder / "a.exr", makeFlat(0.5f));
  flat::write(folder / "wide.exr", makeFlat(0.5f, 9));
  const std::string a = folder / "a.exr", wide = folder / "wide.exr";
  struct Case {
    std::string arguments;
    const char* expected;
  };
  for (const auto& [arguments, expected] :
       {Case{a + " " + wide, "wide.exr: expected the data window of the reference"},
        Case{a + " none.exr", "none.exr: expected a readable file"},
        Case{a + " " + a + " --correct", "variance.R: expected in the reference"},
        Case{a + " " + a + " --clip 3", "--clip: expected two deep images"},
        Case{kDeep + " " + kDeep + " --clip far", "--clip: expected a depth or `median`, found `far`"},
        Case{kDeep + " " + kDeepReference + " --correct", "variance.R: expected in the reference"},
        Case{FATHOM_DEMO "/sequence.####.deep.exr " + kReference + " --frames 1-9",
             "sequence.####.deep.exr: expected every frame"},
        Case{FATHOM_DEMO "/sequence.####.deep.exr " + kReference + " --heatmap h.png",
             "--heatmap: expected a numbered name"}}) {
    const Ran ran = runFathom("compare " + arguments);
    EXPECT_EQ(ran.status, 1) << arguments;
    EXPECT_THAT(ran.err, AllOf(HasSubstr(expected), MatchesRegex("fathom: [^\n]*\n"))) << arguments;
  }
  EXPECT_EQ(runFathom("compare " + a).status, 2);
  EXPECT_EQ(runFathom("compare --help").status, 0);
}

}  // namespace
}  // namespace fathom
