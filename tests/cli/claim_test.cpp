#include "cli/claim.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "flat/output_file.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::cli {
namespace {

namespace fs = std::filesystem;

fs::path touch(const fs::path& path, std::chrono::hours age = {}) {
  std::ofstream(path) << "x";
  fs::last_write_time(path, fs::file_time_type::clock::now() - age);
  return path;
}

std::string machine() {
  char name[256] = "";
  gethostname(name, sizeof name - 1);
  return name;
}

// A process that is no more.
pid_t deadProcess() {
  const pid_t child = fork();
  if (child == 0) _exit(0);
  waitpid(child, nullptr, 0);
  return child;
}

TEST(Claim, OnlyOneHasIt) {
  const TemporaryFolder folder;
  const std::string output = folder / "a.exr";
  std::shared_ptr<const Claim> first = Claim::take({output});
  ASSERT_TRUE(first);
  EXPECT_FALSE(Claim::take({output}));
  EXPECT_TRUE(Claim::take({folder / "b.exr"}));
  first.reset();
  EXPECT_TRUE(Claim::take({output}));
  EXPECT_FALSE(fs::exists(output + ".claim")) << "the last one lets go of it at once";
}

TEST(Claim, EndsWithTheProcessThatWasKilled) {
  const TemporaryFolder folder;
  const std::string output = folder / "a.exr";
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  if (child == 0) {
    const std::shared_ptr<const Claim> claim = Claim::take({output});
    (void)!write(ready[1], claim ? "y" : "n", 1);
    pause();
  }
  char answer = 0;
  ASSERT_EQ(read(ready[0], &answer, 1), 1);
  ASSERT_EQ(answer, 'y');
  EXPECT_FALSE(Claim::take({output}));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_TRUE(fs::exists(output + ".claim"));
  EXPECT_TRUE(Claim::take({output}));
  close(ready[0]);
  close(ready[1]);
}

TEST(Claim, OfADoneOutputIsCleared) {
  const TemporaryFolder folder;
  const std::string output = folder / "a.exr";
  Claim::clear({output});
  EXPECT_FALSE(fs::exists(output + ".claim"));
  touch(output + ".claim");
  Claim::clear({output});
  EXPECT_FALSE(fs::exists(output + ".claim"));
  const std::shared_ptr<const Claim> claim = Claim::take({output});
  Claim::clear({output});
  EXPECT_FALSE(Claim::take({output})) << "whoever has it keeps it";
}

TEST(Claim, AFolderThatIsMissingIsAnErrorThatNamesTheOutput) {
  const TemporaryFolder folder;
  const std::string output = folder / "none/a.exr";
  try {
    Claim::take({output});
    FAIL() << "expected an error";
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find(output), std::string::npos) << e.what();
  }
}

TEST(Claim, RemovesWhatTheDeadLeftAndNothingElse) {
  const TemporaryFolder folder;
  const std::string output = folder / "a.exr";
  const auto left = [&](const std::string& host, pid_t process, const std::string& name = "a.exr") {
    return fs::path(folder / fmt::format("{}.{}-{}-0.tmp", name, host, process));
  };
  const fs::path dead = touch(left(machine(), deadProcess()));
  const fs::path alive = touch(left(machine(), getpid()), std::chrono::hours(5));
  const fs::path recent = touch(left("elsewhere", 1)), old = touch(left("elsewhere", 2), std::chrono::hours(2));
  const fs::path flattened = touch(left(machine(), deadProcess(), "flat.exr"));
  const fs::path other = touch(left(machine(), deadProcess(), "b.exr"));
  const fs::path plain = touch(folder / "a.exr.notes.txt", std::chrono::hours(9));
  EXPECT_TRUE(Claim::take({output, folder / "flat.exr"}));
  EXPECT_TRUE(fs::exists(dead)) << "nobody had claimed it";
  touch(output + ".claim");
  EXPECT_TRUE(Claim::take({output, folder / "flat.exr"}));
  EXPECT_FALSE(fs::exists(dead));
  EXPECT_FALSE(fs::exists(flattened));
  EXPECT_FALSE(fs::exists(old));
  for (const fs::path& kept : {alive, recent, other, plain}) EXPECT_TRUE(fs::exists(kept)) << kept;
}

}  // namespace
}  // namespace fathom::cli
