// The language of chains: words, the stack, arguments, text files.
#include "cli/chain.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::cli {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Pair;
using Words = std::vector<std::string>;

std::string errorOf(const Words& words) {
  try {
    parseChain(words);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

TEST(Chain, TakesImagesOffTheStack) {
  const Chain chain =
      parseChain(Words{"a.exr", "b.exr", "--merge", "tidy", "--clip", "0", "12", "--flatten", "-o", "c.exr"});
  ASSERT_EQ(chain.nodes.size(), 5u);
  EXPECT_EQ(chain.nodes[0].file.text(), "a.exr");
  EXPECT_THAT(chain.nodes[2].inputs, ElementsAre(0, 1));
  EXPECT_THAT(chain.nodes[2].arguments, ElementsAre(Pair("tidy", "1")));
  EXPECT_THAT(chain.nodes[3].inputs, ElementsAre(2));
  EXPECT_THAT(chain.nodes[3].arguments, ElementsAre(Pair("far", "12"), Pair("near", "0")));
  ASSERT_EQ(chain.outputs.size(), 1u);
  EXPECT_EQ(chain.outputs[0].node, 4u);
}

TEST(Chain, MergesAllThatIsOnTheStack) {
  EXPECT_THAT(parseChain(Words{"a", "b", "c", "--merge"}).nodes[3].inputs, ElementsAre(0, 1, 2));
}

TEST(Chain, DoublesExchangesAndDropsTheTop) {
  const Chain chain = parseChain(Words{"a", "--dup", "--clip", "0", "1", "-o", "near.exr", "--pop", "-o", "all.exr",
                                       "b", "--swap", "-o", "a.exr"});
  ASSERT_EQ(chain.outputs.size(), 3u);
  EXPECT_EQ(chain.outputs[0].node, 1u);
  EXPECT_EQ(chain.outputs[1].node, 0u);
  EXPECT_EQ(chain.outputs[2].node, 0u);
}

TEST(Chain, TakesArgumentsByNameInAnyOrder) {
  const Chain chain = parseChain(Words{"a", "part=beauty", "--clip", "far=inf", "-3"});
  EXPECT_EQ(chain.nodes[0].part, "beauty");
  EXPECT_THAT(chain.nodes[1].arguments, ElementsAre(Pair("far", "inf"), Pair("near", "-3")));
}

TEST(Chain, SaysWhatItDoesNotUnderstand) {
  EXPECT_THAT(errorOf({}), HasSubstr("an empty chain"));
  EXPECT_THAT(errorOf({"a", "--clp"}), HasSubstr("--clp: expected an operation"));
  EXPECT_THAT(errorOf({"a", "--flat"}), HasSubstr("is it --flatten?"));
  EXPECT_THAT(errorOf({"a", "--clip", "0"}), HasSubstr("--clip: expected far"));
  EXPECT_THAT(errorOf({"a", "--clip", "0", "high"}), HasSubstr("far: expected a number, found high"));
  EXPECT_THAT(errorOf({"a", "--clip", "near=0", "near=1", "2"}), HasSubstr("near: expected once"));
  EXPECT_THAT(errorOf({"a", "--crop", "1,2,3"}), HasSubstr("expected x,y,width,height, found 1,2,3"));
  EXPECT_THAT(errorOf({"a", "--merge"}), HasSubstr("--merge: expected 2 images on the stack, found 1"));
  EXPECT_THAT(errorOf({"--flatten"}), HasSubstr("expected 1 image on the stack, found 0"));
  EXPECT_THAT(errorOf({"a", "-o", "b.tif"}), HasSubstr("ends in .exr or .png, found b.tif"));
  EXPECT_THAT(errorOf({"a", "-x"}), HasSubstr("-x: expected a file"));
}

TEST(Chain, TextComesBackAsWords) {
  const Words words = {"a b.exr", "--expression", "R=\"x\" \\ y", "#1.exr", "-o", "", "c.exr"};
  EXPECT_EQ(chainWords(chainText(words)), words);
  EXPECT_THAT(chainWords("# a comment\na --clip 0 1 # no comment\n\n  # another\nb"),
              ElementsAre("a", "--clip", "0", "1", "#", "no", "comment", "b"));
  EXPECT_THROW(chainWords("a \"b"), Error);
}

TEST(Chain, ErrorsAreOneLineWhateverTheWordsHold) {
  for (const Words& words : {Words{"a", "--x\ny"}, Words{"-x\ny"}, Words{"a", "-o", "x\ny"}, Words{"a\n#.#"},
                             Words{"a", "--clip", "0", "1\n2"}, Words{"a", "--flatten", "z=x\ny"}}) {
    EXPECT_THAT(errorOf(words), AllOf(HasSubstr("expected"), Not(HasSubstr("\n"))));
  }
  EXPECT_THAT(errorOf({"a", "--expression", "R = G;\n\tB = R"}), "");
}

TEST(Chain, WordsWithAnyKindOfSpaceComeBack) {
  const Words words{"a\vb", "\f", "c d"};
  EXPECT_EQ(chainWords(chainText(words)), words);
}

TEST(Chain, FilesStandForTheirWords) {
  const TemporaryFolder folder;
  std::ofstream(folder / "inner") << "--clip 0 1\n";
  std::ofstream(folder / "outer") << "# both\n--chain " << folder / "inner"
                                  << " --flatten\n";
  std::ofstream(folder / "endless") << "--chain " << folder / "endless";
  EXPECT_THAT(withChainFiles(Words{"a", "--chain", folder / "outer", "-o", "b.exr"}),
              ElementsAre("a", "--clip", "0", "1", "--flatten", "-o", "b.exr"));
  EXPECT_THROW(withChainFiles(Words{"--chain", folder / "endless"}), Error);
  EXPECT_THROW(withChainFiles(Words{"--chain", folder / "none"}), Error);
  EXPECT_THROW(withChainFiles(Words{"--chain", folder.path()}), Error);
  EXPECT_THROW(withChainFiles(Words{"--chain"}), Error);
}

std::string errorOfFile(const std::string& path) {
  try {
    withChainFiles(Words{"--chain", path});
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

// Files that name files twice each would grow to more words than any memory holds.
TEST(Chain, FilesDoNotMultiplyWithoutEnd) {
  const TemporaryFolder folder;
  std::ofstream(folder / "0") << "a.exr";
  for (int i = 1; i < 15; ++i)
    for (int twice = 0; twice < 12; ++twice)
      std::ofstream(folder / std::to_string(i), std::ios::app) << "--chain " << folder / std::to_string(i - 1) << "\n";
  EXPECT_EQ(errorOfFile(folder / "2"), "");
  EXPECT_THAT(errorOfFile(folder / "14"), HasSubstr("expected chains of at most 1048576 bytes, found more"));
  EXPECT_THAT(errorOfFile("/dev/zero"), HasSubstr("/dev/zero: expected chains of at most"));
}

}  // namespace
}  // namespace fathom::cli
