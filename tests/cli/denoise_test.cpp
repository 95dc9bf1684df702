#include <OpenEXR/ImfDeepScanLineInputFile.h>
#include <OpenEXR/ImfDeepScanLineOutputPart.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"
#include "tests/reference/noisy_frame.h"
#include "tests/reference/run_fathom.h"
#include "tests/reference/temporary_folder.h"

namespace fathom {
namespace {

using deep::DeepImage;
using reference::makeNoisyFrame;
using testing::HasSubstr;
using testing::Not;

// A folder with frames in.0001.exr to in.000N.exr.
class Denoise : public testing::Test {
 protected:
  void writeFrames(int count, int width = 24, int height = 20) {
    for (int i = 1; i <= count; ++i)
      deep::write(folder_ / fmt::format("in.{:04}.exr", i), makeNoisyFrame(width, height, unsigned(i)));
  }
  Ran run(const std::string& arguments, const std::string& before = "") const {
    return runFathom("denoise " + arguments, "cd '" + folder_.path() + "'; " + before);
  }
  bool exists(const std::string& name) const { return std::filesystem::exists(folder_ / name); }
  std::string bytes(const std::string& name) const { return textOf(folder_ / name); }
  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
      names.insert(entry.path().filename().string());
    return names;
  }

  TemporaryFolder folder_;
};

void expectSameValues(const DeepImage& a, const DeepImage& b, const std::string& channel) {
  const deep::Channel* x = a.find(channel);
  const deep::Channel* y = b.find(channel);
  ASSERT_TRUE(x && y) << channel;
  EXPECT_TRUE(std::equal(x->values.begin(), x->values.end(), y->values.begin(), y->values.end())) << channel;
  EXPECT_TRUE(std::equal(x->ids.begin(), x->ids.end(), y->ids.begin(), y->ids.end())) << channel;
}

std::set<std::string> namesOf(const DeepImage& image) {
  std::set<std::string> names;
  for (const deep::Channel& channel : image.channels) names.insert(channel.name);
  return names;
}

TEST_F(Denoise, BinsStayAndColoursChange) {
  writeFrames(1);
  const Ran outcome = run("in.0001.exr -o out.exr");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("out.exr"));
  const DeepImage in = deep::read(folder_ / "in.0001.exr"), out = deep::read(folder_ / "out.exr");
  EXPECT_TRUE(std::equal(in.offsets.begin(), in.offsets.end(), out.offsets.begin(), out.offsets.end()));
  for (const char* channel : {"A", "Z", "id", "crypto"}) expectSameValues(in, out, channel);
  EXPECT_EQ(out.find("id")->type, deep::PixelType::Uint);
  EXPECT_NE(out.get("R")[0], in.get("R")[0]);
  EXPECT_EQ(out.attributes.getString("artist"), "nobody");
  const std::set<std::string> names = namesOf(out);
  EXPECT_TRUE(names.contains("diffuse.G") && names.contains("specular.B"));
  for (const std::string& name : names)
    EXPECT_FALSE(name.starts_with("half") || name.starts_with("variance") || name == "samples") << name;
}

TEST_F(Denoise, KeepKeepsTheStatistics) {
  writeFrames(1);
  ASSERT_EQ(run("in.0001.exr -o out.exr --keep").status, 0);
  const DeepImage in = deep::read(folder_ / "in.0001.exr"), out = deep::read(folder_ / "out.exr");
  EXPECT_EQ(namesOf(in), namesOf(out));
  for (const char* channel : {"half0.diffuse.R", "variance.R", "samples"}) expectSameValues(in, out, channel);
}

TEST_F(Denoise, BandsAndThreadsDoNotShow) {
  deep::write(folder_ / "in.exr", makeNoisyFrame(40, 150, 1));
  ASSERT_EQ(run("in.exr -o whole.exr --flat-guide none --flat whole.flat.exr --threads 1 --stats whole.json").status,
            0);
  const std::string whole = bytes("whole.exr");
  for (const char* options : {"--threads 2", "--threads 5", "--threads 2 --memory 7M", "--threads 1 --memory 9M"}) {
    const Ran outcome = run(fmt::format(
        "in.exr -o out.exr --flat-guide none --flat out.flat.exr --overwrite --stats out.json {}", options));
    ASSERT_EQ(outcome.status, 0) << options << outcome.err;
    EXPECT_TRUE(bytes("out.exr") == whole) << options;
    // The flat file knows the time it was written at: its pixels are compared.
    const flat::Image expected = flat::read(folder_ / "whole.flat.exr"), found = flat::read(folder_ / "out.flat.exr");
    for (const flat::Plane& plane : expected.planes)
      EXPECT_TRUE(std::equal(plane.values.begin(), plane.values.end(), found.get(plane.name).values.begin()))
          << options;
    const auto stats = nlohmann::json::parse(bytes("out.json"));
    if (std::string(options).find("memory") != std::string::npos) {
      EXPECT_GT(stats["frames"][0]["bands"], 1) << options;
    }
    for (const char* name : {"out.exr", "out.flat.exr"}) std::filesystem::remove(folder_ / name);
  }
}

TEST_F(Denoise, TooLittleMemoryIsOneLine) {
  writeFrames(1, 200, 10);
  const Ran outcome = run("in.0001.exr -o out.exr --memory 64k");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("in.0001.exr"));
  EXPECT_FALSE(exists("out.exr"));
}

TEST_F(Denoise, FlatIsTheFlattenedOutput) {
  writeFrames(1);
  ASSERT_EQ(run("in.0001.exr -o out.exr --flat flat.exr").status, 0);
  const flat::Image expected = deep::flatten(deep::read(folder_ / "out.exr")), found = flat::read(folder_ / "flat.exr");
  EXPECT_EQ(found.dataWindow, expected.dataWindow);
  for (const flat::Plane& plane : expected.planes) {
    const flat::Plane& other = found.get(plane.name);
    EXPECT_TRUE(std::equal(plane.values.begin(), plane.values.end(), other.values.begin())) << plane.name;
  }
}

TEST_F(Denoise, ComponentsGetFilesOfTheirOwn) {
  writeFrames(1);
  ASSERT_EQ(run("in.####.exr -o out.####.exr --split").status, 0);
  const DeepImage out = deep::read(folder_ / "out.0001.exr"), diffuse = deep::read(folder_ / "out.diffuse.0001.exr");
  EXPECT_TRUE(exists("out.specular.0001.exr"));
  EXPECT_FALSE(diffuse.find("diffuse.R") || diffuse.find("specular.R"));
  const auto expected = out.get("diffuse.G"), found = diffuse.get("G");
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), found.begin(), found.end()));
}

TEST_F(Denoise, ComponentsThatAreNotThereAreAnError) {
  DeepImage image = makeNoisyFrame(8, 8, 1);
  for (const char* channel : {"R", "G", "B"}) image.erase(std::string("diffuse.") + channel);
  deep::write(folder_ / "in.exr", image);
  const Ran outcome = run("in.exr -o out.exr --split");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("in.exr: expected diffuse.* and specular.*"));
}

TEST_F(Denoise, AFlatFileGivesAFlatOne) {
  flat::Image image = deep::flatten(makeNoisyFrame(16, 12, 1));
  flat::write(folder_ / "in.exr", image);
  const Ran outcome = run("in.exr -o out.exr");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const flat::Image out = flat::read(folder_ / "out.exr");
  EXPECT_EQ(out.dataWindow, image.dataWindow);
  for (const char* same : {"A", "Z", "crypto"})
    EXPECT_TRUE(std::equal(image.get(same).values.begin(), image.get(same).values.end(), out.get(same).values.begin()))
        << same;
  EXPECT_EQ(out.attributes.at("fathom:spp"), "16");
  EXPECT_EQ(run("in.exr -o out2.exr --flat out3.exr").status, 1);
  // And it is known again.
  EXPECT_THAT(run("in.exr -o out.exr").out, HasSubstr("done before"));
}

TEST_F(Denoise, ASequenceThatIsDoneIsLeftAlone) {
  writeFrames(3);
  ASSERT_EQ(run("in.####.exr -o out.%04d.exr").status, 0);
  const std::string before = bytes("out.0002.exr");
  struct stat info {};
  ASSERT_EQ(stat((folder_ / "out.0002.exr").c_str(), &info), 0);
  std::filesystem::remove(folder_ / "out.0003.exr");
  const Ran again = run("in.####.exr -o out.%04d.exr --stats stats.json");
  EXPECT_EQ(again.status, 0);
  const auto stats = nlohmann::json::parse(bytes("stats.json"));
  EXPECT_EQ(stats["total"]["frames"]["kept"], 2);
  EXPECT_EQ(stats["total"]["frames"]["done"], 1);
  struct stat after {};
  ASSERT_EQ(stat((folder_ / "out.0002.exr").c_str(), &after), 0);
  EXPECT_EQ(after.st_ino, info.st_ino);
  EXPECT_TRUE(exists("out.0003.exr"));
}

TEST_F(Denoise, PartsOfASequenceAgree) {
  writeFrames(3);
  ASSERT_EQ(run("in.####.exr -o all.####.exr").status, 0);
  ASSERT_EQ(run("in.####.exr -o part.####.exr --frames 2-3").status, 0);
  EXPECT_FALSE(exists("part.0001.exr"));
  for (const char* frame : {"0002", "0003"})
    EXPECT_TRUE(bytes(fmt::format("all.{}.exr", frame)) == bytes(fmt::format("part.{}.exr", frame)));
}

TEST_F(Denoise, WhatOthersMadeIsRefusedByName) {
  writeFrames(2);
  ASSERT_EQ(run("in.####.exr -o out.####.exr").status, 0);
  const std::string before = bytes("out.0001.exr");
  // Other settings.
  Ran outcome = run("in.####.exr -o out.####.exr --quality fast");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, testing::AllOf(HasSubstr("out.0001.exr: expected nothing there"), HasSubstr("out.0002.exr"),
                                          HasSubstr("--overwrite")));
  EXPECT_TRUE(bytes("out.0001.exr") == before);
  // Another input of one frame; the other frame is known.
  deep::write(folder_ / "in.0002.exr", makeNoisyFrame(24, 20, 77));
  outcome = run("in.####.exr -o out.####.exr");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, testing::AllOf(Not(HasSubstr("out.0001.exr")), HasSubstr("out.0002.exr")));
  const std::string stale = bytes("out.0002.exr");
  EXPECT_EQ(run("in.####.exr -o out.####.exr --overwrite").status, 0);
  EXPECT_FALSE(bytes("out.0002.exr") == stale);
  // A file that is none of ours.
  std::ofstream(folder_ / "out.0001.exr") << "text";
  EXPECT_EQ(run("in.####.exr -o out.####.exr").status, 1);
  EXPECT_EQ(bytes("out.0001.exr"), "text");
}

TEST_F(Denoise, AFilterIsASettingOfDeepAndFlatFrames) {
  writeFrames(1);
  flat::write(folder_ / "flat.exr", deep::flatten(deep::read(folder_ / "in.0001.exr")));
  for (const std::string in : {"in.0001.exr", "flat.exr"}) {
    ASSERT_EQ(run(in + " -o own-" + in).status, 0);
    EXPECT_EQ(run(in + " -o own-" + in + " --filter own").status, 0);
    for (const std::string filter : {"paper", "rdfc"}) {
      EXPECT_EQ(run(in + " -o own-" + in + " --filter " + filter).status, 1) << "not made by " << filter;
      const std::string out = filter + "-" + in;
      const Ran outcome = run(in + " -o " + out + " --filter " + filter);
      EXPECT_EQ(outcome.status, 0) << outcome.err;
      EXPECT_THAT(outcome.err, Not(HasSubstr("guided")));
      EXPECT_FALSE(bytes(out) == bytes("own-" + in));
    }
    EXPECT_FALSE(bytes("paper-" + in) == bytes("rdfc-" + in));
  }
}

TEST_F(Denoise, AKilledRunContinues) {
  writeFrames(6, 60, 60);
  ASSERT_EQ(run("in.####.exr -o whole.####.exr").status, 0);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    if (chdir(folder_.path().c_str()) != 0 || !freopen("/dev/null", "w", stdout)) _exit(99);
    setenv("FATHOM_OIDN_LIBRARY", "/nowhere", 1);  // as runFathom has it
    execl(FATHOM_BINARY, "fathom", "denoise", "in.####.exr", "-o", "out.####.exr", nullptr);
    _exit(99);
  }
  while (!exists("out.0001.exr") && waitpid(child, nullptr, WNOHANG) == 0) std::this_thread::yield();
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  ASSERT_TRUE(exists("out.0001.exr"));
  const Ran outcome = run("in.####.exr -o out.####.exr");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("out.0001.exr: done before"));
  for (int i = 1; i <= 6; ++i)
    EXPECT_TRUE(bytes(fmt::format("out.{:04}.exr", i)) == bytes(fmt::format("whole.{:04}.exr", i))) << i;
}

TEST_F(Denoise, AStoppedRunLeavesNoHalves) {
  writeFrames(1, 60, 60);
  // Far more frames than can be done before the signal comes.
  for (int i = 2; i <= 300; ++i)
    std::filesystem::create_hard_link(folder_ / "in.0001.exr", folder_ / fmt::format("in.{:04}.exr", i));
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    if (chdir(folder_.path().c_str()) != 0 || !freopen("/dev/null", "w", stdout) || !freopen("/dev/null", "w", stderr))
      _exit(99);
    setenv("FATHOM_OIDN_LIBRARY", "/nowhere", 1);  // as runFathom has it
    execl(FATHOM_BINARY, "fathom", "denoise", "in.####.exr", "-o", "out.####.exr", nullptr);
    _exit(99);
  }
  while (!exists("out.0001.exr")) std::this_thread::yield();
  kill(child, SIGTERM);
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 130);
  for (const std::string& name : files()) {
    EXPECT_TRUE(name.ends_with(".exr")) << name;
    EXPECT_NO_THROW(deep::read(folder_ / name)) << name;
  }
}

TEST_F(Denoise, AMissingFrameFailsOrIsSkipped) {
  writeFrames(4);
  std::filesystem::remove(folder_ / "in.0002.exr");
  Ran outcome = run("in.####.exr -o out.####.exr --frames 1-4");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("in.####.exr: frame missing: 2"));
  for (const char* done : {"out.0001.exr", "out.0003.exr", "out.0004.exr"}) EXPECT_TRUE(exists(done));
  outcome = run("in.####.exr -o out.####.exr --frames-missing skip");
  EXPECT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.err, HasSubstr("missing: 2"));
}

TEST_F(Denoise, ABrokenFrameDoesNotStopTheOthers) {
  writeFrames(3);
  const std::string whole = bytes("in.0002.exr");
  std::ofstream(folder_ / "in.0002.exr", std::ios::binary) << whole.substr(0, whole.size() / 2);
  Ran outcome = run("in.####.exr -o out.####.exr");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("in.0002.exr"));
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  EXPECT_TRUE(exists("out.0001.exr") && exists("out.0003.exr"));
  EXPECT_FALSE(exists("out.0002.exr"));
  // The first one broken: the method is decided from the next.
  std::filesystem::copy_file(folder_ / "in.0002.exr", folder_ / "in.0001.exr",
                             std::filesystem::copy_options::overwrite_existing);
  outcome = run("in.####.exr -o new.####.exr");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 2) << outcome.err;
  EXPECT_TRUE(exists("new.0003.exr"));
}

TEST_F(Denoise, AFrameWithoutAChannelOfTheFirstFailsByName) {
  writeFrames(2);
  DeepImage image = makeNoisyFrame(24, 20, 2);
  image.erase("albedo.R");
  deep::write(folder_ / "in.0002.exr", image);
  const Ran outcome = run("in.####.exr -o out.####.exr");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, testing::AllOf(HasSubstr("in.0002.exr"), HasSubstr("albedo.R")));
  EXPECT_TRUE(exists("out.0001.exr"));
  EXPECT_FALSE(exists("out.0002.exr"));
}

TEST_F(Denoise, NoPlaceToWriteIsOneLine) {
  writeFrames(1);
  std::ofstream(folder_ / "file") << "x";
  for (const char* place : {"file/out.exr", "gone/out.exr"}) {
    const Ran outcome = run(fmt::format("in.0001.exr -o {}", place));
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr(place));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
}

TEST_F(Denoise, AFullDiskLeavesNothing) {
  writeFrames(2);
  const Ran outcome = run("in.####.exr -o out.####.exr", "trap '' XFSZ; ulimit -f 8;");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, testing::AllOf(HasSubstr("out.0001.exr"), HasSubstr("out.0002.exr")));
  EXPECT_EQ(files(), (std::set<std::string>{"in.0001.exr", "in.0002.exr"}));
}

TEST_F(Denoise, TheInputIsNeverTheOutput) {
  writeFrames(1);
  std::filesystem::create_symlink("in.0001.exr", folder_ / "link.exr");
  const std::string before = bytes("in.0001.exr");
  for (const char* arguments :
       {"in.0001.exr -o in.0001.exr", "in.0001.exr -o ./in.0001.exr --overwrite",
        "in.####.exr -o in.####.exr --overwrite", "in.0001.exr -o link.exr --overwrite",
        "in.0001.exr -o out.exr --flat in.0001.exr --overwrite", "in.0001.exr -o out.exr --flat out.exr"}) {
    const Ran outcome = run(arguments);
    EXPECT_EQ(outcome.status, 2) << arguments;
    EXPECT_THAT(outcome.err, HasSubstr("expected")) << arguments;
  }
  EXPECT_TRUE(bytes("in.0001.exr") == before);
  EXPECT_FALSE(exists("out.exr"));
}

TEST_F(Denoise, UsageErrorsExitWith2) {
  writeFrames(1);
  for (const char* arguments :
       {"in.0001.exr", "in.####.exr -o out.exr", "in.0001.exr -o out.####.exr", "in.0001.exr -o out.png",
        "in.0001.exr -o out.exr --quality wonderful", "in.0001.exr -o out.exr --filter bilateral",
        "in.0001.exr -o out.exr --filter rdfc --time-budget 1", "in.0001.exr -o out.exr --half a.exr",
        "in.0001.exr -o out.exr --threads 0", "in.0001.exr -o out.exr --memory lots",
        "in.0001.exr -o out.exr --frames 1-2", "in.####.exr -o out.####.exr --frames 2-1",
        "in.##.##.exr -o out.####.exr"})
    EXPECT_EQ(run(arguments).status, 2) << arguments;
  EXPECT_EQ(run("gone.exr -o out.exr").status, 1);
  EXPECT_EQ(run("gone.####.exr -o out.####.exr").status, 1);
}

// A flat part "note" before the deep part "beauty".
void writeTwoParts(const std::string& path, const std::string& flatPath, const std::string& deepPath) {
  Imf::InputFile flatFile(flatPath.c_str());
  Imf::DeepScanLineInputFile deepFile(deepPath.c_str());
  std::array<Imf::Header, 2> headers = {flatFile.header(), deepFile.header()};
  headers[0].setName("note");
  headers[0].setType(Imf::SCANLINEIMAGE);
  headers[0].displayWindow() = headers[1].displayWindow();
  headers[1].setName("beauty");
  Imf::MultiPartOutputFile file(path.c_str(), headers.data(), 2);
  Imf::OutputPart(file, 0).copyPixels(flatFile);
  Imf::DeepScanLineOutputPart(file, 1).copyPixels(deepFile);
}

TEST_F(Denoise, OtherPartsAreCarriedOver) {
  deep::write(folder_ / "deep.exr", makeNoisyFrame(24, 20, 1));
  flat::Image note{{0, 0, 5, 4}, {0, 0, 24, 20}, {}, {}};
  note.add("note.Y", 0.125f);
  flat::write(folder_ / "flat.exr", note);
  writeTwoParts(folder_ / "in.exr", folder_ / "flat.exr", folder_ / "deep.exr");
  for (const char* options : {"", "--part beauty", "--part 1 --memory 5M"}) {
    const Ran outcome = run(fmt::format("in.exr -o out.exr {} --overwrite", options));
    ASSERT_EQ(outcome.status, 0) << options << outcome.err;
    ASSERT_EQ(deep::readParts(folder_ / "out.exr").size(), 2u);
    EXPECT_EQ(flat::read(folder_ / "out.exr", {.part = "note"}).get("note.Y").values[3], 0.125f);
    EXPECT_NE(deep::read(folder_ / "out.exr").get("R")[0], deep::read(folder_ / "in.exr").get("R")[0]);
  }
  EXPECT_THAT(run("in.exr -o out.exr --part 7").err, HasSubstr("in.exr: expected a part 7"));
}

TEST_F(Denoise, CameraSamplesBecomeBinsFirst) {
  // Eight camera samples in every pixel, four at each of two depths.
  constexpr int kSpp = 8, kWidth = 12, kHeight = 9;
  DeepImage image{{0, 0, kWidth, kHeight}, {0, 0, kWidth, kHeight}, {}, {}, {}};
  image.offsets = Buffer<uint64_t>(image.pixels() + 1);
  for (size_t i = 0; i <= image.pixels(); ++i) image.offsets[i] = kSpp * i;
  std::mt19937 random(5);
  for (const char* name : {"R", "G", "B", "A", "Z"}) {
    Buffer<float>& values = image.add(name, deep::PixelType::Float).values;
    for (size_t i = 0; i < values.size(); ++i) {
      const float k = float(i % kSpp), alpha = 1 / (kSpp - k);
      values[i] = name[0] == 'A'   ? alpha
                  : name[0] == 'Z' ? (k < 4 ? 2 : 9) + 0.001f * k
                                   : alpha * float(random() % 100);
    }
  }
  image.attributes.set("fathom:spp", kSpp);
  image.attributes.set("fathom:ppuScale", 20.0f);
  deep::write(folder_ / "in.exr", image);
  const Ran outcome = run("in.exr -o out.exr --keep");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("clustered into bins first"));
  const DeepImage out = deep::read(folder_ / "out.exr");
  EXPECT_EQ(out.samples(), 2 * image.pixels());
  EXPECT_EQ(out.get("samples")[0], 4.0f);
  EXPECT_EQ(out.get("A")[1], 1.0f);

  image.attributes.erase("fathom:ppuScale");
  deep::write(folder_ / "in.exr", image);
  const Ran without = run("in.exr -o new.exr");
  EXPECT_EQ(without.status, 1);
  EXPECT_THAT(without.err, testing::AllOf(HasSubstr("in.exr"), HasSubstr("fathom cluster"), HasSubstr("--ppu-scale")));
}

TEST_F(Denoise, InPiecesEqualsInOne) {
  const DeepImage image = makeNoisyFrame(24, 20, 1);
  deep::write(folder_ / "whole.exr", image);
  const auto only = [&](const std::string& name, const std::function<bool(const std::string&)>& keep) {
    DeepImage part = image.copy();
    std::erase_if(part.channels, [&](const deep::Channel& channel) { return !keep(channel.name); });
    deep::write(folder_ / name, part);
  };
  const auto isFeature = [](const std::string& name) {
    return name.find("albedo.") != std::string::npos || name.find("N.") != std::string::npos || name == "variance.Z";
  };
  only("main.exr", [&](const std::string& name) { return !isFeature(name); });
  only("features.exr", [&](const std::string& name) { return isFeature(name) || name == "A" || name == "Z"; });
  ASSERT_EQ(run("whole.exr -o a.exr").status, 0);
  const Ran outcome = run("main.exr -o b.exr --features features.exr");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const DeepImage a = deep::read(folder_ / "a.exr"), b = deep::read(folder_ / "b.exr");
  for (const char* channel : {"R", "G", "B", "diffuse.R", "A"}) expectSameValues(a, b, channel);
}

TEST_F(Denoise, HalvesFromFilesOfTheirOwn) {
  const DeepImage image = makeNoisyFrame(24, 20, 1);
  DeepImage main = image.copy();
  std::erase_if(main.channels, [](const deep::Channel& channel) { return channel.name.starts_with("half"); });
  deep::write(folder_ / "whole.exr", image);
  deep::write(folder_ / "main.exr", main);
  for (const std::string prefix : {"half0.", "half1."}) {
    DeepImage half = image.copyLayout();
    for (const char* same : {"A", "Z"})
      std::copy(image.get(same).begin(), image.get(same).end(), half.add(same, deep::PixelType::Float).values.begin());
    for (const deep::Channel& channel : image.channels)
      if (channel.name.starts_with(prefix))
        std::copy(channel.values.begin(), channel.values.end(),
                  half.add(channel.name.substr(prefix.size()), deep::PixelType::Float).values.begin());
    deep::write(folder_ / (prefix + "exr"), half);
  }
  ASSERT_EQ(run("whole.exr -o a.exr").status, 0);
  const Ran outcome = run("main.exr -o b.exr --half half0.exr half1.exr");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const DeepImage a = deep::read(folder_ / "a.exr"), b = deep::read(folder_ / "b.exr");
  for (const char* channel : {"R", "diffuse.R", "A"}) expectSameValues(a, b, channel);
}

TEST_F(Denoise, BetterAlphasComeFromAnotherFile) {
  const DeepImage image = makeNoisyFrame(24, 20, 1);
  deep::write(folder_ / "in.exr", image);
  DeepImage better = image.copy();
  for (float& a : better.get("A"))
    if (a < 1) a *= 0.5f;
  deep::write(folder_ / "better.exr", better);
  ASSERT_EQ(run("in.exr -o out.exr --alpha better.exr").status, 0);
  const DeepImage out = deep::read(folder_ / "out.exr");
  const auto expected = std::as_const(better).get("A");
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(out.get("A")[i], expected[i], 1e-6f);
}

TEST_F(Denoise, NamesOfAnotherRenderer) {
  DeepImage image = makeNoisyFrame(24, 20, 1);
  deep::write(folder_ / "ours.exr", image);
  for (deep::Channel& channel : image.channels)
    if (channel.name.starts_with("albedo."))
      channel.name = "surface_" + channel.name.substr(0, 6) + "." + channel.name.substr(7);
  deep::write(folder_ / "theirs.exr", image);
  std::ofstream(folder_ / "map.txt") << "albedo = surface_albedo\n";
  ASSERT_EQ(run("ours.exr -o a.exr").status, 0);
  const Ran outcome = run("theirs.exr -o b.exr --map map.txt");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const DeepImage a = deep::read(folder_ / "a.exr"), b = deep::read(folder_ / "b.exr");
  for (const char* channel : {"R", "G", "B"}) expectSameValues(a, b, channel);
}

TEST_F(Denoise, NonFiniteSamplesAreToldOnce) {
  DeepImage image = makeNoisyFrame(24, 20, 1);
  for (const char* channel : {"R", "diffuse.R", "half0.R", "half0.diffuse.R"}) image.get(channel)[5] = std::nanf("");
  deep::write(folder_ / "in.exr", image);
  const Ran outcome = run("in.exr -o out.exr");
  EXPECT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.err, HasSubstr("in.exr: 1 sample"));
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
}

TEST_F(Denoise, UnsortedSamplesAreSorted) {
  DeepImage image = makeNoisyFrame(24, 20, 1);
  deep::write(folder_ / "sorted.exr", image);
  for (size_t pixel = 0; pixel < image.pixels(); ++pixel)
    if (image.count(pixel) == 2)
      for (deep::Channel& channel : image.channels) {
        const size_t first = size_t(image.offsets[pixel]);
        if (channel.type == deep::PixelType::Uint)
          std::swap(channel.ids[first], channel.ids[first + 1]);
        else
          std::swap(channel.values[first], channel.values[first + 1]);
      }
  deep::write(folder_ / "unsorted.exr", image);
  ASSERT_EQ(run("sorted.exr -o a.exr").status, 0);
  const Ran outcome = run("unsorted.exr -o b.exr");
  ASSERT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.err, HasSubstr("unsorted.exr: samples are sorted"));
  const DeepImage a = deep::read(folder_ / "a.exr"), b = deep::read(folder_ / "b.exr");
  for (const char* channel : {"R", "A", "Z", "id"}) expectSameValues(a, b, channel);
}

TEST_F(Denoise, OverlappingVolumesAreTheSameInBands) {
  // Volumes that overlap in the last rows only.
  constexpr int kWidth = 60, kHeight = 200;
  DeepImage image{{0, 0, kWidth, kHeight}, {0, 0, kWidth, kHeight}, {}, {}, {}};
  image.offsets = Buffer<uint64_t>(image.pixels() + 1);
  for (size_t i = 0; i <= image.pixels(); ++i) image.offsets[i] = 2 * i;
  std::mt19937 random(5);
  for (const char* name : {"R", "G", "B", "A", "Z", "ZBack"}) {
    Buffer<float>& values = image.add(name, deep::PixelType::Float).values;
    for (size_t i = 0; i < values.size(); ++i) {
      const bool behind = i % 2, overlap = i > values.size() * 9 / 10;
      const float z = behind ? (overlap ? 1.5f : 3.0f) : 1.0f;
      values[i] = name[0] == 'Z' ? (name[1] ? z + 1 : z) : name[0] == 'A' ? 0.5f : 0.005f * float(random() % 100);
    }
  }
  deep::write(folder_ / "in.exr", image);
  ASSERT_EQ(run("in.exr -o whole.exr").status, 0);
  const Ran outcome = run("in.exr -o bands.exr --memory 3M --stats stats.json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_GT(nlohmann::json::parse(bytes("stats.json"))["frames"][0]["bands"], 1);
  EXPECT_THAT(outcome.err, HasSubstr("overlapping volumes are split and merged first"));
  EXPECT_GT(deep::read(folder_ / "whole.exr").samples(), image.samples());
  EXPECT_TRUE(bytes("whole.exr") == bytes("bands.exr"));

  // Where bins have statistics, they stay as they are.
  image.add("samples", deep::PixelType::Float).values.fill(4);
  deep::write(folder_ / "bins.exr", image);
  ASSERT_EQ(run("bins.exr -o out.exr --keep").status, 0);
  EXPECT_EQ(deep::read(folder_ / "out.exr").samples(), image.samples());
}

}  // namespace
}  // namespace fathom
