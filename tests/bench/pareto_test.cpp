#include <gmock/gmock.h>

#include <cmath>

#include "base/error.h"
#include "deep/alpha.h"
#include "deep/flatten.h"
#include "tests/bench/pareto_frames.h"
#include "tests/bench/pareto_report.h"

namespace fathom::bench {
namespace {

using deep::Quality;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(Measure, GeometricMeans) {
  EXPECT_NEAR(geometricMean({2, 8}), 4, 1e-12);
  EXPECT_NEAR(geometricMean({3}), 3, 1e-12);
  EXPECT_NEAR(geometricMean({-1, 1e-9}), 1e-9, 1e-15) << "a correction may overshoot";
  EXPECT_TRUE(std::isnan(geometricMean({})));
}

TEST(Measure, CsvQuotesWhatNeedsIt) {
  Table table("", {"name", "a,b"});
  table.add({"plain", 0.12345678901});
  table.add({"a, \"b\"", ""});
  EXPECT_EQ(csvOf(table), "name,\"a,b\"\nplain,0.12345678901\n\"a, \"\"b\"\"\",\n");
}

TEST(Measure, MarkdownHasItsColumnsAligned) {
  Table table("Title", {"a", "long name"});
  table.add({"word", 1.5});
  EXPECT_EQ(markdownOf(table), "\nTitle\n\n| a    | long name |\n| ---- | --------- |\n| word | 1.5       |\n");
}

TEST(Plot, NothingBeatsTheFront) {
  const std::vector<Point> points = {{"slow", 4, 1},   {"beaten", 3, 3}, {"quick", 1, 5},
                                     {"middle", 2, 2}, {"equal", 2, 4},  {"other", 0.5, 0.5, 1}};
  std::vector<std::string> names;
  for (const Point& point : front(points, 0)) names.push_back(point.name);
  EXPECT_THAT(names, ElementsAre("quick", "middle", "slow"));
  EXPECT_EQ(front(points, 1).size(), 1);
  EXPECT_TRUE(front(points, 2).empty());
}

TEST(Plot, NamesAreEscapedAndOddPointsLeftOut) {
  EXPECT_EQ(escaped("a<b> & \"c\""), "a&lt;b&gt; &amp; &quot;c&quot;");
  const Plot plot{"t", "x", "y", {{"fast & good", 1, 2}, {"none", 0, 1}, {"nan", 1, std::nan("")}, {"b", 3, 1}}};
  const std::string svg = svgOf(plot);
  EXPECT_THAT(svg, HasSubstr(">fast &amp; good</text>"));
  EXPECT_EQ(svg.find("none"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svgOf({"", "", "", {}}).find("<circle"), std::string::npos);
}

TEST(Plot, ThePictureHasThePointsColours) {
  const flat::Image image = imageOf({"t", "x", "y", {{"a", 1, 2}, {"b", 3, 1, 1}}});
  size_t red = 0, blue = 0;
  for (size_t i = 0; i < image.dataWindow.area(); ++i) {
    const float r = image.get("R").values[i], b = image.get("B").values[i];
    red += r > b + 0.3f;
    blue += b > r + 0.3f;
  }
  EXPECT_GT(red, 150);  // a disc of radius 8
  EXPECT_GT(blue, 150);
}

// `perPixel` of `spp` slots have a sample, at depths 1, 2, ... with colours 1, 2, ... (not premultiplied).
deep::DeepImage cameraSamples(int width, int spp, int perPixel) {
  const Box window{0, 0, width, 1};
  deep::DeepImage image{window, window, Buffer<uint64_t>(window.area() + 1), {}, {}};
  for (size_t p = 0; p <= window.area(); ++p) image.offsets[p] = p * size_t(perPixel);
  for (const char* name : {"R", "G", "B", "A", "Z"}) image.add(name, deep::PixelType::Float);
  for (size_t i = 0; i < image.samples(); ++i) {
    const auto k = double(i % size_t(perPixel));
    image.get("A")[i] = float((1.0 / spp) / (1 - k / spp));
    image.get("Z")[i] = float(k + 1);
    for (const char* name : {"R", "G", "B"}) image.get(name)[i] = image.get("A")[i] * float(k + 1);
  }
  image.attributes.set("fathom:spp", spp);
  return image;
}

TEST(ParetoFrames, AllSamplesAreTheRender) {
  const deep::DeepImage all = cameraSamples(5, 4, 4), some = someSamples(all, 4);
  EXPECT_TRUE(std::equal(all.offsets.begin(), all.offsets.end(), some.offsets.begin()));
  for (const char* name : {"R", "A", "Z"})
    for (size_t i = 0; i < all.samples(); ++i) EXPECT_NEAR(some.get(name)[i], all.get(name)[i], 1e-6f) << name;
}

TEST(ParetoFrames, SomeSamplesAreARenderOfFewerWithoutBias) {
  constexpr int kPixels = 4000;
  const deep::DeepImage some = someSamples(cameraSamples(kPixels, 8, 6), 2);
  EXPECT_EQ(some.attributes.getInt("fathom:spp"), 2);
  for (const float share : deep::effectiveAlpha(some)) EXPECT_NEAR(share, 0.5f, 1e-6f);
  EXPECT_NEAR(double(some.samples()) / kPixels, 2 * 6.0 / 8, 0.03) << "slots without a sample count";
  double sum = 0;
  const flat::Image flat = deep::flatten(some);
  for (const float value : flat.get("R").values) sum += double(value);
  // (1 + ... + 6) / 8; a pixel's deviation is below 2.3.
  EXPECT_NEAR(sum / kPixels, 21.0 / 8, 4 * 2.3 / std::sqrt(2.0 * kPixels));
  EXPECT_THROW(someSamples(cameraSamples(1, 8, 8), 9), Error);
  EXPECT_THROW(someSamples(cameraSamples(1, 8, 8), 0), Error);
}

// Deep costs of 2 + 3 per bin, a network of 7, timed at 1.5 bins.
ParetoResult madeUp() {
  ParetoResult result;
  const auto add = [&](const std::string& name, const cli::DenoiseSetting& setting, double seconds, double error) {
    std::optional<double> bins;
    if (setting.deep) bins = 4 * error;
    result.methods.push_back({{name, setting}, seconds, {{"as rendered", "a", 1, error, bins ? 2 : bins, bins}}});
  };
  add("fast", {Quality::Fast, true, "none"}, 6.5, 0.04);
  add("fast + oidn", {Quality::Fast, true, "oidn"}, 13.5, 0.01);
  add("nlm fast", {Quality::Fast, false, "nlm"}, 5, 0.02);
  result.methods[0].errors.push_back({"as rendered", "b", 1, 0.01, {}, {}});
  result.sets = {"as rendered"};
  result.binsPerPixel = 1.5;
  result.calibration = 0.25;
  return result;
}

TEST(ParetoReport, MeansAreGeometricAndOfTheFramesThatHaveThem) {
  const MeanErrors means = meansOf(madeUp().methods[0], "as rendered");
  EXPECT_THAT(means.flattened.value(), DoubleNear(0.02, 1e-9));
  EXPECT_THAT(means.bins.value(), DoubleNear(0.16, 1e-9));
  EXPECT_THAT(means.binsShare.value(), DoubleNear(0.08, 1e-9));
  EXPECT_FALSE(meansOf(madeUp().methods[2], "as rendered").bins);
  EXPECT_FALSE(meansOf(madeUp().methods[0], "2 samples").flattened);
}

TEST(ParetoReport, CostsAreALineThroughFlatAndDeep) {
  EXPECT_EQ(costRows(madeUp()),
            "{{Quality::Fast, true, \"none\"}, 2, 3, 0, 0.04},\n"
            "{{Quality::Fast, true, \"oidn\"}, 2, 3, 7, 0.0141},\n"
            "{{Quality::Fast, false, \"nlm\"}, 5, 0, 0, 0.02},\n"
            "constexpr double kCalibration = 0.25;\n");
}

TEST(ParetoReport, TheNetworkCostsTheSameAtAnyQuality) {
  ParetoResult result = madeUp();
  for (const auto& [with, seconds] : {std::pair("none", 10.0), std::pair("oidn", 19.0)})
    result.methods.push_back({{with, {Quality::Best, true, with}}, seconds, {}});
  EXPECT_THAT(costRows(result), HasSubstr("{Quality::Fast, true, \"oidn\"}, 2, 3, 8,")) << "7 and 9";
}

TEST(ParetoReport, TheNetworkCostsByLightsAndComponents) {
  ParetoResult result = madeUp();
  result.lights = 2;
  for (const int components : {0, 4})
    result.methods.push_back(
        {{"neural", {Quality::Fast, false, "neural", components}}, 3, {{"as rendered", "a", 1, 0.02, {}, {}}}});
  EXPECT_THAT(costRows(result), HasSubstr("{{Quality::Fast, false, \"neural\", 4}, 0, 0, 1.5, 0.02},\nconstexpr"));
}

TEST(ParetoReport, NoCostIsBelowZero) {
  ParetoResult result = madeUp();
  result.methods[2].secondsPerMegapixel = 1;  // a steeper line than through nothing
  EXPECT_THAT(costRows(result), HasSubstr("\"none\"}, 0, 4.33, 0,"));
  result.methods[2].secondsPerMegapixel = 9;  // a falling line
  EXPECT_THAT(costRows(result), HasSubstr("\"none\"}, 6.5, 0, 0,"));
}

TEST(ParetoReport, PlotsHaveWhatIsKnown) {
  EXPECT_EQ(setPlot(madeUp(), "as rendered", false).points.size(), 3);
  EXPECT_EQ(setPlot(madeUp(), "as rendered", true).points.size(), 2);
  EXPECT_TRUE(setPlot(madeUp(), "2 samples", false).points.empty());
  EXPECT_EQ(frameTable(madeUp()).rows().size(), 4);
}

}  // namespace
}  // namespace fathom::bench
