#include "cli/sequence.h"

#include <gmock/gmock.h>

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "base/error.h"

namespace fathom::cli {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string newFolder(const std::string& name) {
  std::string folder = testing::TempDir() + "sequence_" + name + "_" + std::to_string(::getpid());
  std::filesystem::create_directories(folder);
  return folder;
}

void touch(const std::string& path) {
  std::ofstream(path) << "x";
}

std::string errorOf(auto&& call) {
  try {
    call();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

TEST(FilePattern, HashesAndPrintfNameTheSameFiles) {
  for (const char* path : {"shots/a.####.exr", "shots/a.%04d.exr"}) {
    const FilePattern pattern = parsePattern(path);
    EXPECT_TRUE(pattern.numbered());
    EXPECT_EQ(pattern.at(7), "shots/a.0007.exr");
    EXPECT_EQ(pattern.at(12345), "shots/a.12345.exr");
    EXPECT_EQ(pattern.at(-3), "shots/a.-003.exr");
    EXPECT_EQ(pattern.text(), "shots/a.####.exr");
  }
  EXPECT_EQ(parsePattern("a.%d.exr").at(12), "a.12.exr");
  EXPECT_EQ(parsePattern("a.#.exr").at(12), "a.12.exr");
}

TEST(FilePattern, PlainNamesStayAsTheyAre) {
  for (const char* path : {"a.exr", "take#2/a.exr", "50%.exr", "a%5d.exr", "a%", "%04x.exr"}) {
    EXPECT_FALSE(parsePattern(path).numbered()) << path;
    EXPECT_EQ(parsePattern(path).at(7), path);
  }
}

TEST(FilePattern, TwoPlacesAreRefused) {
  EXPECT_THAT(errorOf([] { parsePattern("a.##.%04d.exr"); }), HasSubstr("a.##.%04d.exr: expected one place"));
  EXPECT_THAT(errorOf([] { parsePattern("a." + std::string(40, '#')); }), HasSubstr("found 40"));
}

TEST(ParseFrames, RangesStepsAndLists) {
  EXPECT_THAT(parseFrames("7"), ElementsAre(7));
  EXPECT_THAT(parseFrames("1-9x4"), ElementsAre(1, 5, 9));
  EXPECT_THAT(parseFrames("1-10x4"), ElementsAre(1, 5, 9));
  EXPECT_THAT(parseFrames("5-7,1,6,3"), ElementsAre(1, 3, 5, 6, 7));
  EXPECT_THAT(parseFrames("-2-1"), ElementsAre(-2, -1, 0, 1));
  EXPECT_THAT(parseFrames("-5--3"), ElementsAre(-5, -4, -3));
  EXPECT_THAT(parseFrames("2147483646-2147483647"), ElementsAre(2147483646, 2147483647));
}

TEST(ParseFrames, WhatItDoesNotUnderstandIsNamed) {
  for (const char* text : {"", "a", "1-", "1-2x0", "1-2x-1", "1-2x", "3-1", "1,,2", "1,", "1 2", "99999999999", "1--"})
    EXPECT_THAT(errorOf([&] { parseFrames(text); }), HasSubstr("expected a form such as")) << text;
  EXPECT_THAT(errorOf([] { parseFrames("1-2000000000"); }), HasSubstr("at most"));
}

TEST(FindSequence, WithoutARangeTheDiskSaysWhatThereIs) {
  const std::string folder = newFolder("disk");
  for (const char* name : {"a.0001.exr", "a.0002.exr", "a.0004.exr", "a.10000.exr", "a.-001.exr"})
    touch(folder + "/" + name);
  // Other padding, other ends, no number: not of this sequence.
  for (const char* name :
       {"a.3.exr", "a.00005.exr", "a.0006.exr.part", "a..exr", "a.0x07.exr", "b.0008.exr", "a.+009.exr"})
    touch(folder + "/" + name);
  const Sequence sequence = findSequence(folder + "/a.####.exr", "");
  EXPECT_THAT(sequence.frames, ElementsAre(-1, 1, 2, 4, 10000));
  EXPECT_EQ(sequence.missing.size(), 1u + 1u + 9995u);  // 0, 3, 5 to 9999
  std::filesystem::remove_all(folder);
}

TEST(FindSequence, AFrameMissesFromTheStepThatTheFilesHave) {
  const std::string folder = newFolder("step");
  for (int f : {1, 3, 7, 9}) touch(folder + "/a." + std::to_string(f) + ".exr");
  const Sequence onTwos = findSequence(folder + "/a.%d.exr", "");
  EXPECT_THAT(onTwos.missing, ElementsAre(5));
  const Sequence asked = findSequence(folder + "/a.#.exr", "1-3,11");
  EXPECT_THAT(asked.frames, ElementsAre(1, 3));
  EXPECT_THAT(asked.missing, ElementsAre(2, 11));
  std::filesystem::remove_all(folder);
}

TEST(FindSequence, NothingFoundIsAnError) {
  const std::string folder = newFolder("none");
  EXPECT_THAT(errorOf([&] { findSequence(folder + "/a.####.exr", ""); }),
              HasSubstr("a.####.exr: expected at least one"));
  EXPECT_THAT(errorOf([&] { findSequence(folder + "/gone/a.####.exr", ""); }), HasSubstr("expected a folder"));
  EXPECT_THAT(errorOf([&] { findSequence(folder + "/a.exr", "1-3"); }), HasSubstr("found a plain name"));
  EXPECT_THAT(findSequence(folder + "/a.exr", "").frames, ElementsAre(0));
  std::filesystem::remove_all(folder);
}

TEST(DescribeFrames, RunsAreShort) {
  EXPECT_EQ(describeFrames({1, 2, 3, 4, 7, 9, 10}), "1-4, 7, 9-10");
  EXPECT_EQ(describeFrames({}), "");
}

}  // namespace
}  // namespace fathom::cli
