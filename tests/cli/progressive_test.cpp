// `fathom progressive` and `fathom denoise --error` as a user runs them.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "cli/claim.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"
#include "tests/reference/noisy_flat.h"
#include "tests/reference/noisy_frame.h"
#include "tests/reference/run_fathom.h"
#include "tests/reference/temporary_folder.h"

namespace fathom {
namespace {

using flat::Image;
using testing::HasSubstr;
using testing::Not;

// A folder with passes in.0001.exr and so on of 16, 64, 256 samples per pixel.
class Progressive : public testing::Test {
 protected:
  void writePasses(int count) {
    for (int i = 1; i <= count; ++i) {
      const int half = 2 << (2 * i);
      reference::NoisyFlat frame =
          reference::makeNoisyFlat(80, 50, unsigned(i), 0.8f / std::sqrt(float(2 * half)), half, half);
      frame.noisy.add("A", 1);
      frame.noisy.add("Z", 2);
      flat::write(folder_ / fmt::format("in.{:04}.exr", i), frame.noisy);
    }
  }
  Ran run(const std::string& arguments) const { return runFathom(arguments, "cd '" + folder_.path() + "';"); }
  Image read(const std::string& name) const { return flat::read(folder_ / name); }
  bool exists(const std::string& name) const { return std::filesystem::exists(folder_ / name); }

  // Mean squared error of R against the truth of makeNoisyFlat, which is the same for all passes.
  double error(const Image& image) const {
    const Image truth = reference::makeNoisyFlat(80, 50, 1).truth;
    double sum = 0;
    for (size_t i = 0; i < 4000; ++i) {
      const double e = double(image.get("R").values[i]) - double(truth.get("R").values[i]);
      sum += e * e / 4000;
    }
    return sum;
  }

  TemporaryFolder folder_;
};

std::set<std::string> namesOf(const Image& image) {
  std::set<std::string> names;
  for (const flat::Plane& plane : image.planes) names.insert(plane.name);
  return names;
}

TEST_F(Progressive, EveryPassGetsABetterResult) {
  writePasses(3);
  const Ran ran = run("progressive in.####.exr -o out.####.exr --error");
  ASSERT_EQ(ran.status, 0) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("out.0003.exr: 256 spp, estimated relMSE"));
  double last = 1;
  for (int i = 1; i <= 3; ++i) {
    const Image in = read(fmt::format("in.{:04}.exr", i)), out = read(fmt::format("out.{:04}.exr", i));
    EXPECT_LT(error(out), 0.6 * error(in));
    EXPECT_LT(error(out), last);
    last = error(out);
    double estimate = 0;
    for (const float v : out.get("error.R").values) estimate += double(v) / 4000;
    EXPECT_NEAR(std::log(estimate / last), 0, std::log(2));  // one pass; over seeds it is within a quarter
  }
  EXPECT_EQ(namesOf(read("out.0001.exr")),
            (std::set<std::string>{"R", "G", "B", "A", "Z", "error.R", "error.G", "error.B"}));
}

TEST_F(Progressive, ErrorsAreLeftOutUnlessAskedFor) {
  writePasses(1);
  ASSERT_EQ(run("progressive in.0001.exr -o out.exr").status, 0);
  EXPECT_EQ(namesOf(read("out.exr")), (std::set<std::string>{"R", "G", "B", "A", "Z"}));
}

TEST_F(Progressive, APassThatAnotherProcessMakesIsLeftToIt) {
  writePasses(3);
  {
    const auto claim = cli::Claim::take({folder_ / "out.0001.exr"});
    const Ran ran = run("progressive in.####.exr -o out.####.exr");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_THAT(ran.out, HasSubstr("out.0001.exr: another process is at it"));
    EXPECT_THAT(ran.err, Not(HasSubstr("expected more than")));
    EXPECT_FALSE(exists("out.0001.exr"));
    EXPECT_TRUE(exists("out.0003.exr"));
    // Whoever asks for estimates works on it, and leaves the file to the other.
    EXPECT_THAT(run("progressive in.0001.exr -o one.exr --report one.json").status, 0);
    EXPECT_EQ(run("progressive in.####.exr -o out.####.exr --report all.json").status, 0);
    EXPECT_FALSE(exists("out.0001.exr"));
    const auto passes = nlohmann::json::parse(textOf(folder_ / "all.json"))["passes"];
    const auto one = nlohmann::json::parse(textOf(folder_ / "one.json"))["passes"];
    EXPECT_EQ(passes[0]["relMSE"], one[0]["relMSE"]);
  }
  EXPECT_EQ(run("progressive in.####.exr -o out.####.exr").status, 0);
  EXPECT_TRUE(exists("out.0001.exr"));
  EXPECT_FALSE(exists("out.0001.exr.claim"));
}

TEST_F(Progressive, ThreadsDoNotShow) {
  writePasses(1);
  ASSERT_EQ(run("progressive in.0001.exr -o a.exr --threads 1").status, 0);
  ASSERT_EQ(run("progressive in.0001.exr -o b.exr --threads 4").status, 0);
  EXPECT_EQ(textOf(folder_ / "a.exr"), textOf(folder_ / "b.exr"));
}

// Our own filter tells its error by itself where there are half buffers, and by probes where there are none.
TEST_F(Progressive, RunsProbesWhereTheFilterDoesNotTell) {
  writePasses(1);
  Image silent = read("in.0001.exr");
  std::erase_if(silent.planes, [](const auto& p) { return p.name.starts_with("half"); });
  flat::write(folder_ / "silent.exr", silent);
  for (const std::string name : {"in.0001", "silent"}) {
    ASSERT_EQ(run(fmt::format("progressive {}.exr -o {}.a.exr --error", name, name)).status, 0);
    ASSERT_EQ(run(fmt::format("progressive {}.exr -o {}.b.exr --error --probes 2", name, name)).status, 0);
    const Image a = read(name + ".a.exr"), b = read(name + ".b.exr");
    EXPECT_EQ(std::ranges::equal(a.get("error.R").values, b.get("error.R").values), name == "silent");
  }
}

TEST_F(Progressive, DenoiseWritesErrorsOfFlatFrames) {
  writePasses(1);
  Image silent = read("in.0001.exr");
  std::erase_if(silent.planes, [](const auto& p) { return p.name.starts_with("half"); });
  flat::write(folder_ / "silent.exr", silent);
  for (const std::string name : {"in.0001", "silent"}) {
    ASSERT_EQ(run(fmt::format("denoise {}.exr -o plain.exr --overwrite", name)).status, 0);
    const Ran ran = run(fmt::format("denoise {}.exr -o out.exr --error --overwrite", name));
    ASSERT_EQ(ran.status, 0) << ran.err;
    const Image plain = read("plain.exr"), out = read("out.exr");
    EXPECT_TRUE(std::ranges::equal(plain.get("R").values, out.get("R").values));
    double estimate = 0;
    for (const float v : out.get("error.R").values) estimate += double(v) / 4000;
    EXPECT_NEAR(std::log(estimate / error(out)), 0, std::log(1.6)) << name;
  }
}

TEST_F(Progressive, SaysWhereToStop) {
  writePasses(3);
  const Ran all = run("progressive in.####.exr -o out.####.exr --report all.json");
  ASSERT_EQ(all.status, 0) << all.err;
  const auto without = nlohmann::json::parse(textOf(folder_ / "all.json"));
  EXPECT_FALSE(without.contains("target"));
  ASSERT_EQ(without["passes"].size(), 3u);
  EXPECT_EQ(without["passes"][2]["spp"], 256);
  const double first = without["passes"][0]["relMSE"], second = without["passes"][1]["relMSE"];
  EXPECT_LT(second, first);
  EXPECT_GT(without["passes"][0]["renderRelMSE"], first);

  // Outputs that are there are estimated all the same, and stay.
  const double target = (first + second) / 2;
  const Ran ran = run(fmt::format("progressive in.####.exr -o out.####.exr --report r.json --target {}", target));
  ASSERT_EQ(ran.status, 0) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("in.0002.exr: estimated relMSE"));
  EXPECT_THAT(ran.out, HasSubstr("stop rendering here"));
  EXPECT_THAT(ran.out, Not(HasSubstr("in.0003.exr: estimated")));
  const auto report = nlohmann::json::parse(textOf(folder_ / "r.json"));
  EXPECT_EQ(report["stopAt"], "in.0002.exr");
  EXPECT_EQ(report["passes"][0]["reached"], false);
  EXPECT_EQ(report["passes"][1]["reached"], true);
  const auto& tiles = report["passes"][1]["tiles"];
  ASSERT_EQ(tiles.size(), 2u);
  EXPECT_EQ(tiles[1]["width"], 16);
  EXPECT_EQ(tiles[1]["x"], 61);
  EXPECT_EQ(tiles[0]["reached"], tiles[0]["relMSE"] <= target);

  const Ran none = run("progressive in.####.exr -o out.####.exr --target 1e-9");
  EXPECT_THAT(none.out, HasSubstr("render on"));
}

TEST_F(Progressive, WhatIsDoneIsLeftAloneAndWhatIsNotOursRefused) {
  writePasses(2);
  ASSERT_EQ(run("progressive in.####.exr -o out.####.exr").status, 0);
  std::filesystem::remove(folder_ / "out.0002.exr");
  const auto before = std::filesystem::last_write_time(folder_ / "out.0001.exr");
  const Ran again = run("progressive in.####.exr -o out.####.exr");
  EXPECT_THAT(again.out, HasSubstr("out.0001.exr: done before"));
  EXPECT_EQ(std::filesystem::last_write_time(folder_ / "out.0001.exr"), before);
  EXPECT_TRUE(exists("out.0002.exr"));

  const Ran other = run("progressive in.####.exr -o out.####.exr --probes 1");
  EXPECT_EQ(other.status, 1);
  EXPECT_THAT(other.err, HasSubstr("out.0001.exr: expected nothing there"));
  EXPECT_EQ(run("progressive in.####.exr -o out.####.exr --probes 1 --overwrite").status, 0);
}

TEST_F(Progressive, FailsByNameAndGoesOn) {
  writePasses(2);
  Image silent = read("in.0001.exr");
  std::erase_if(silent.planes, [](const auto& p) { return p.name.starts_with("var") || p.name.starts_with("half"); });
  flat::write(folder_ / "in.0001.exr", silent);
  const Ran ran = run("progressive in.####.exr -o out.####.exr");
  EXPECT_EQ(ran.status, 1);
  EXPECT_THAT(ran.err, HasSubstr("in.0001.exr: channel R: expected variance.*"));
  EXPECT_FALSE(exists("out.0001.exr"));
  EXPECT_TRUE(exists("out.0002.exr"));
}

TEST_F(Progressive, DenoiseWritesErrorsOfDeepFramesThatFlattenToThePixels) {
  deep::write(folder_ / "deep.exr", reference::makeNoisyFrame(40, 30, 1));
  ASSERT_EQ(run("denoise deep.exr -o plain.exr").status, 0);
  const Ran ran = run("denoise deep.exr -o out.exr --flat flat.exr --error");
  ASSERT_EQ(ran.status, 0) << ran.err;
  const deep::DeepImage plain = deep::read(folder_ / "plain.exr"), out = deep::read(folder_ / "out.exr");
  EXPECT_TRUE(std::ranges::equal(plain.get("R"), out.get("R")));
  const Image flat = read("flat.exr"), expected = deep::flatten(out);
  double sum = 0;
  for (size_t i = 0; i < flat.dataWindow.area(); ++i) {
    EXPECT_NEAR(flat.get("error.G").values[i], expected.get("error.G").values[i], 1e-7);
    EXPECT_GE(flat.get("error.G").values[i], 0);
    sum += double(flat.get("error.G").values[i]);
  }
  EXPECT_GT(sum, 0);
}

}  // namespace
}  // namespace fathom
