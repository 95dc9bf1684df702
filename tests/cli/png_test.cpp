// `fathom png` as a user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "flat/io.h"
#include "flat/tonemap.h"
#include "tests/reference/run_fathom.h"

namespace fathom {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

// 4 x 2 pixels, R rising by 1/16 a pixel, a display window of 6 x 3 around it.
flat::Image makeRamp() {
  flat::Image image{{1, 1, 5, 3}, {0, 0, 6, 3}, {}, {}};
  for (const char* name : {"R", "G", "B", "Z"}) image.add(name);
  for (size_t i = 0; i < 8; ++i) image.planes[0].values[i] = float(i) / 16;
  for (size_t i = 0; i < 8; ++i) image.planes[3].values[i] = 10 + 2 * float(i);
  return image;
}

class PngCommand : public ::testing::Test {
 protected:
  void SetUp() override { flat::write(folder / "ramp.exr", makeRamp()); }
  flat::Image show(const std::string& arguments) {
    const Ran ran = runFathom("png " + (folder / "ramp.exr") + " -o " + (folder / "shown.png") + " " + arguments);
    EXPECT_EQ(ran.status, 0) << ran.err;
    return flat::read(folder / "shown.png");
  }
  const TemporaryFolder folder;
};

float at(const flat::Image& image, const char* channel, int x, int y) {
  return image.get(channel).values[image.dataWindow.index(x, y)];
}

TEST_F(PngCommand, ShowsTheDisplayWindowThroughTheSrgbCurve) {
  const flat::Image shown = show("");
  ASSERT_EQ(shown.dataWindow, (Box{0, 0, 6, 3}));
  EXPECT_EQ(at(shown, "R", 0, 0), 0);
  EXPECT_NEAR(at(shown, "R", 4, 2), flat::srgb(7.0 / 16), 0.5 / 255);
  EXPECT_EQ(at(shown, "G", 4, 2), 0);
}

TEST_F(PngCommand, ExposureIsInStops) {
  EXPECT_NEAR(at(show("--exposure 1"), "R", 4, 1), flat::srgb(6.0 / 16), 0.5 / 255);
  EXPECT_NEAR(at(show("--exposure -2"), "R", 4, 1), flat::srgb(3.0 / 64), 0.5 / 255);
}

TEST_F(PngCommand, CropAndZoom) {
  const flat::Image shown = show("--crop 2,1,2,2 --zoom 3");
  ASSERT_EQ(shown.dataWindow, (Box{0, 0, 6, 6}));
  for (int y = 0; y < 6; ++y)
    for (int x = 0; x < 6; ++x)
      EXPECT_NEAR(at(shown, "R", x, y), flat::srgb((1 + x / 3 + 4 * (y / 3)) / 16.0), 0.5 / 255);
}

TEST_F(PngCommand, OneChannelIsSpreadOverItsRange) {
  const flat::Image shown = show("--channels Z --crop 1,1,4,2");
  EXPECT_EQ(at(shown, "R", 0, 0), 0);
  EXPECT_EQ(at(shown, "B", 3, 1), 1);
  EXPECT_NEAR(at(shown, "G", 1, 1), 5.0 / 7, 0.5 / 255);
}

TEST_F(PngCommand, SeveralSideBySideWithLabels) {
  const flat::Image shown = show((folder / "ramp.exr") + " --labels one,two");
  EXPECT_EQ(shown.dataWindow.width(), 6 + 4 + 6);
  EXPECT_GT(shown.dataWindow.height(), 3 + 10);
  EXPECT_EQ(at(shown, "R", 4, 2), at(shown, "R", 4 + 10, 2));
}

TEST_F(PngCommand, ClippingADeepImageRemovesWhatIsOutside) {
  const std::string deep = FATHOM_DEMO "/sequence.0002.deep.exr", out = folder / "clipped.png";
  const auto brightness = [&](const std::string& clip) {
    EXPECT_EQ(runFathom("png " + deep + " -o " + out + clip).status, 0);
    const flat::Image image = flat::read(out);
    double sum = 0;
    for (const float value : image.get("G").values) sum += value;
    return sum;
  };
  const double all = brightness(""), none = brightness(" --clip 0,0.001"), front = brightness(" --clip 0,7");
  EXPECT_EQ(brightness(" --clip 0,inf"), all);
  EXPECT_EQ(none, 0);
  EXPECT_GT(front, 0.05 * all);
  EXPECT_LT(front, 0.95 * all);
}

TEST_F(PngCommand, EveryMistakeIsOneLine) {
  const std::string ramp = folder / "ramp.exr", out = " -o " + (folder / "shown.png");
  struct Case {
    std::string arguments;
    const char* expected;
  };
  for (const auto& [arguments, expected] :
       {Case{ramp + " -o " + (folder / "shown.exr"), "shown.exr: expected a name that ends in .png"},
        Case{ramp + out + " --labels a,b", "--labels: expected one for each of 1 images, found 2"},
        Case{ramp + out + " --channels albedo", "ramp.exr, channel albedo.R: expected"},
        Case{ramp + out + " --crop 0,0,0,5", "expected a picture of 1 to"},
        Case{ramp + out + " --crop 0,0,2000000000,2000000000", "expected a picture of 1 to"},
        Case{"none.exr" + out, "none.exr: expected a readable file"}}) {
    const Ran ran = runFathom("png " + arguments);
    EXPECT_EQ(ran.status, 1) << arguments;
    EXPECT_THAT(ran.err, AllOf(HasSubstr(expected), MatchesRegex("fathom: [^\n]*\n"))) << arguments;
    EXPECT_FALSE(std::filesystem::exists(folder / "shown.png"));
  }
  EXPECT_EQ(runFathom("png " + ramp).status, 2);
}

}  // namespace
}  // namespace fathom
