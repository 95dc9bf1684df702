// `fathom ids`, `points`, `sample`, `stats` and the depths of `flatten`, through files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "deep/flatten.h"
#include "deep/io.h"
#include "deep/ops/ids.h"
#include "deep/ops/points.h"
#include "flat/io.h"
#include "tests/reference/random_ops.h"
#include "tests/reference/run_fathom.h"

namespace fathom {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

// A frame of several bands.
deep::DeepImage makeFrame(unsigned seed) {
  return reference::randomSamples({.window = {-2, 1, 60, 90}, .seed = seed, .volumes = true});
}

TEST(AnalysisCommands, StatsAsJsonAndInAFile) {
  const TemporaryFolder folder;
  const deep::DeepImage image = makeFrame(1);
  deep::write(folder / "a.exr", image);
  const Ran ran = runFathom("stats " + (folder / "a.exr") + " json");
  ASSERT_EQ(ran.status, 0) << ran.err;
  const auto json = nlohmann::json::parse(ran.out);
  EXPECT_EQ(json["samples"]["total"], image.samples());
  EXPECT_EQ(json["channels"].size(), image.channels.size());
  const Ran quiet = runFathom("stats " + (folder / "a.exr") + " json file=" + (folder / "a.json"));
  EXPECT_EQ(quiet.out, "");
  EXPECT_EQ(nlohmann::json::parse(textOf(folder / "a.json")), json);
  EXPECT_THAT(runFathom("stats " + (folder / "a.exr")).out, StartsWith("    samples    "));
}

TEST(AnalysisCommands, SampleOfAChain) {
  const TemporaryFolder folder;
  const deep::DeepImage image = makeFrame(2);
  deep::write(folder / "a.exr", image);
  const Ran all = runFathom("sample " + (folder / "a.exr") + " 7 80 json");
  ASSERT_EQ(all.status, 0) << all.err;
  EXPECT_EQ(nlohmann::json::parse(all.out)["samples"].size(), image.count(image.dataWindow.index(7, 80)));
  const Ran none = runFathom("comp " + (folder / "a.exr") + " --clip 0 0.5 --sample 7 80");
  EXPECT_EQ(none.out, "pixel (7, 80): 0 samples, alpha 0\n");
  const Ran outside = runFathom("sample " + (folder / "a.exr") + " 60 80");
  EXPECT_EQ(outside.status, 1);
  EXPECT_THAT(outside.err, HasSubstr("sample: expected a pixel of the data window, 62 x 89 at -2 1, found 60 80\n"));
}

TEST(AnalysisCommands, PointsOfASequence) {
  const TemporaryFolder folder;
  for (unsigned frame = 1; frame <= 2; ++frame)
    deep::write(folder / ("a.000" + std::to_string(frame) + ".exr"), makeFrame(frame));
  const Ran ran = runFathom("points " + (folder / "a.####.exr") + " " + (folder / "p.####.ply") + " fov=50");
  ASSERT_EQ(ran.status, 0) << ran.err;
  for (unsigned frame = 1; frame <= 2; ++frame) {
    const std::vector<uint8_t> points = deep::plyPoints(makeFrame(frame), {.world = false, .fieldOfView = 50.0f});
    EXPECT_EQ(textOf(folder / ("p.000" + std::to_string(frame) + ".ply")),
              deep::plyHeader(points.size() / deep::kPlyPointBytes) + std::string(points.begin(), points.end()));
  }
}

TEST(AnalysisCommands, PointsLeaveNoFileWhereTheyFail) {
  const TemporaryFolder folder;
  deep::write(folder / "a.exr", makeFrame(1));
  const Ran ran = runFathom("points " + (folder / "a.exr") + " " + (folder / "p.ply"));
  EXPECT_EQ(ran.status, 1);
  EXPECT_THAT(ran.err, HasSubstr("points: "));
  EXPECT_THAT(ran.err, HasSubstr("expected fov"));
  EXPECT_FALSE(std::filesystem::exists(folder / "p.ply"));
}

TEST(AnalysisCommands, IdsKeepTheirBitsInHalfFiles) {
  const TemporaryFolder folder;
  const deep::DeepImage image = makeFrame(3);
  deep::write(folder / "a.exr", image);
  const Ran ran = runFathom("ids " + (folder / "a.exr") + " ranks=4 -o " + (folder / "ids.exr") + " half=1");
  ASSERT_EQ(ran.status, 0) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("of least coverage beyond 4 ranks are left out"));
  const flat::Image expected = deep::rankIds(image, "id", 4).image, found = flat::read(folder / "ids.exr");
  for (const flat::Plane& plane : expected.planes)
    for (size_t p = 0; p < image.pixels(); ++p)
      ASSERT_EQ(std::bit_cast<uint32_t>(found.get(plane.name).values[p]), std::bit_cast<uint32_t>(plane.values[p]));
  EXPECT_EQ(runFathom("ids " + (folder / "a.exr") + " values=1,0x -o " + (folder / "no.exr")).status, 1);
}

TEST(AnalysisCommands, FlattenWithDepths) {
  const TemporaryFolder folder;
  const deep::DeepImage image = makeFrame(4);
  deep::write(folder / "a.exr", image);
  const Ran ran = runFathom("flatten " + (folder / "a.exr") + " z=front at=0.25 depths=transmittance,back -o " +
                            (folder / "flat.exr"));
  ASSERT_EQ(ran.status, 0) << ran.err;
  const flat::Image found = flat::read(folder / "flat.exr");
  const flat::Image expected =
      deep::flatten(image, {deep::FlatDepth::Front, {deep::FlatDepth::Transmittance, deep::FlatDepth::Back}, 0.25});
  EXPECT_EQ(found.planes.size(), expected.planes.size());
  for (const flat::Plane& plane : expected.planes)
    for (size_t p = 0; p < image.pixels(); ++p) ASSERT_EQ(found.get(plane.name).values[p], plane.values[p]);
}

}  // namespace
}  // namespace fathom
