#include "cli/base_denoiser.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>

#include "base/error.h"
#include "deep/flat_nl_means.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"
#include "tests/oidn/installed.h"
#include "tests/reference/noisy_frame.h"
#include "tests/reference/run_fathom.h"
#include "tests/reference/temporary_folder.h"

namespace fathom {
namespace {

using reference::fakeOidn;
using reference::kOidn;
using reference::makeNoisyFrame;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

flat::Image flatFrame(unsigned seed = 1, int width = 24, int height = 20) {
  return deep::flatten(makeNoisyFrame(width, height, seed));
}

// A folder with in.exr, which is flat.
struct Folder : TemporaryFolder {
  Folder() { flat::write(*this / "in.exr", flatFrame()); }
  Ran run(const std::string& arguments) const {
    return runFathom("denoise " + arguments, "cd '" + path() + "'; FATHOM_OIDN_LIBRARY=");
  }
  bool exists(const std::string& name) const { return std::filesystem::exists(*this / name); }
};

long lines(const std::string& text) {
  return std::count(text.begin(), text.end(), '\n');
}

bool sameValues(const flat::Image& a, const flat::Image& b, const char* plane) {
  const Buffer<float>&x = a.get(plane).values, &y = b.get(plane).values;
  return std::equal(x.begin(), x.end(), y.begin(), y.end());
}

TEST(BaseDenoiser, NlmIsFlatNlMeans) {
  const flat::Image noisy = flatFrame();
  const deep::DenoisePlan plan = deep::planFlat(noisy, {}), fast = deep::planFlat(noisy, {deep::Quality::Fast});
  const cli::BaseDenoiser base = cli::makeBase({}, plan, 0);
  EXPECT_TRUE(sameValues(base.denoise(noisy, {}), deep::flatNlMeans(plan)(noisy, {}), "G"));
  EXPECT_NE(base.settings, cli::makeBase({}, fast, 0).settings);
  EXPECT_THROW(cli::makeBase({"oidn", "/nowhere"}, plan, 0), Error);
}

TEST(BaseDenoiser, ALibraryThatIsNotThereIsOneLine) {
  const Folder folder;
  const Ran outcome = folder.run("in.exr -o out.exr --method oidn --oidn-library /nowhere");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("/nowhere: expected Open Image Denoise"));
  EXPECT_EQ(lines(outcome.err), 1) << outcome.err;
  EXPECT_FALSE(folder.exists("out.exr"));
}

TEST(BaseDenoiser, WhatItCannotDoIsUsage) {
  const Folder folder;
  const Ran outcome = folder.run("in.exr -o out.exr --method oidn --split");
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--split"));
  EXPECT_EQ(folder.run("in.exr -o out.exr --method other").status, 2);
}

// A deep frame is guided by it: --flat-guide oidn.
TEST(BaseDenoiser, OfDeepFramesItIsTheGuide) {
  const Folder folder;
  deep::write(folder / "deep.exr", makeNoisyFrame(24, 20, 1));
  for (const char* option : {"--method", "--base", "--flat-guide"}) {
    const Ran outcome =
        folder.run(fmt::format("deep.exr -o out.exr {} oidn --oidn-library {}", option, fakeOidn("fake_oidn_failing")));
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("Open Image Denoise 2.3.0: not enough memory"));
  }
}

TEST(BaseDenoiser, AFilterThatFailsNamesTheFrame) {
  const Folder folder;
  const Ran outcome = folder.run("in.exr -o out.exr --base oidn --oidn-library " + fakeOidn("fake_oidn_failing"));
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("in.exr: Open Image Denoise 2.3.0: not enough memory\n"));
  EXPECT_FALSE(folder.exists("out.exr"));
}

TEST(BaseDenoiser, AFrameIsNeverCut) {
  const Folder folder;
  const flat::Image large = flatFrame(1, 60, 200);
  flat::write(folder / "large.exr", large);
  const size_t bytes = large.planes.size() * large.dataWindow.area() * sizeof(float);
  const Ran outcome = folder.run(fmt::format("large.exr -o out.exr --memory {} --base oidn --oidn-library {}",
                                             2 * bytes, fakeOidn("fake_oidn_failing")));
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("large.exr: expected at least"), HasSubstr("for a whole frame")));
}

class WithOidnDenoise : public reference::WithOidnInstalled {};

TEST_F(WithOidnDenoise, ColoursChangeAndComponentsGo) {
  const Folder folder;
  const Ran outcome = folder.run("in.exr -o out.exr --base oidn --oidn-library " + kOidn);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("in.exr: diffuse.* and specular.* are left out"), Not(HasSubstr("half0"))));
  const flat::Image in = flat::read(folder / "in.exr"), out = flat::read(folder / "out.exr");
  for (const char* plane : {"A", "Z", "albedo.G", "N.X", "crypto"}) EXPECT_TRUE(sameValues(in, out, plane)) << plane;
  EXPECT_FALSE(sameValues(in, out, "R"));
  EXPECT_FALSE(out.find("diffuse.R") || out.find("specular.G"));
  const cli::BaseDenoiser base = cli::makeBase({"oidn", kOidn}, deep::planFlat(in, {}), 1'000'000'000);
  EXPECT_TRUE(sameValues(base.denoise(in, {}), out, "B"));
}

TEST_F(WithOidnDenoise, KnowsItsOwnOutputs) {
  const Folder folder;
  const std::string command = "in.exr -o out.exr --base oidn --oidn-library " + kOidn;
  ASSERT_EQ(folder.run(command).status, 0);
  EXPECT_THAT(folder.run(command).out, HasSubstr("done before"));
  EXPECT_THAT(folder.run(command + " --memory 2G --threads 1").out, HasSubstr("done before"));
  for (const std::string& other : {command + " --quality fast", std::string("in.exr -o out.exr")}) {
    const Ran outcome = folder.run(other);
    EXPECT_EQ(outcome.status, 1) << other;
    EXPECT_THAT(outcome.err, HasSubstr("out.exr: expected nothing there"));
  }
  const Ran named = runFathom("denoise in.exr -o out.exr --base oidn",
                              "cd '" + folder.path() + "'; FATHOM_OIDN_LIBRARY='" + kOidn + "'");
  EXPECT_THAT(named.out, HasSubstr("done before")) << named.err;
}

TEST_F(WithOidnDenoise, ASequenceOfFlatFrames) {
  const Folder folder;
  for (const unsigned frame : {1u, 2u, 3u}) {
    flat::Image image = flatFrame(frame);
    std::erase_if(image.planes, [](const flat::Plane& plane) { return plane.name.starts_with("N."); });
    flat::write(folder / fmt::format("in.{}.exr", frame), image);
  }
  const Ran outcome = folder.run("in.#.exr -o out.#.exr --method oidn --quality fast --oidn-library " + kOidn);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("no N.*: the albedo guides alone"));
  for (const int frame : {1, 2, 3}) EXPECT_TRUE(folder.exists(fmt::format("out.{}.exr", frame)));
}

}  // namespace
}  // namespace fathom
