// `fathom train`: that it starts the training's programs with what they need. Stand-ins are run by sh; the real ones are
// tested in tests/nn.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "tests/reference/run_fathom.h"
#include "tests/reference/temporary_folder.h"

namespace fathom {
namespace {

using testing::HasSubstr;
using testing::Not;

class Train : public testing::Test {
 protected:
  TemporaryFolder folder;

  Train() {
    std::filesystem::create_directories(folder / "programs");
    std::filesystem::create_directories(folder / "renders");
    program("train.py", "echo \"$@\" > train.txt");
    program("export.py", "echo \"$@\" > export.txt");
  }

  void program(const std::string& name, const std::string& text) const {
    std::ofstream(folder / ("programs/" + name)) << text << '\n';
  }
  Ran run(const std::string& options) const {
    return runFathom("train " + options, "cd '" + folder.path() + "'; FATHOM_TRAIN=programs");
  }
};

TEST_F(Train, TrainsAndExports) {
  const Ran done = run("renders programs -o out --model base --steps 123 --threads 3 --data 'our renders' --python sh");
  ASSERT_EQ(done.status, 0) << done.err;
  EXPECT_THAT(textOf(folder / "train.txt"),
              HasSubstr("--data renders programs --out out --width 32 --steps 123 --threads 3"));
  EXPECT_EQ(textOf(folder / "export.txt"), "out out/base.safetensors --data our renders --frames renders programs\n");
  EXPECT_THAT(done.out, HasSubstr("--method neural --model out/base.safetensors"));
}

TEST_F(Train, AFailureIsOneLineAndNothingIsExported) {
  program("train.py", "exit 3");
  const Ran failed = run("renders -o out --python sh");
  EXPECT_EQ(failed.status, 1);
  EXPECT_THAT(failed.err, HasSubstr("programs/train.py: ended with status 3"));
  EXPECT_FALSE(std::filesystem::exists(folder / "export.txt"));
  EXPECT_THAT(failed.out, Not(HasSubstr("--method")));
}

TEST_F(Train, WhatIsMissingIsNamed) {
  EXPECT_THAT(run("renders -o out --python no_such_python").err, HasSubstr("no_such_python: "));
  EXPECT_EQ(run("nowhere -o out").status, 2);
  std::filesystem::remove(folder / "programs/train.py");
  EXPECT_THAT(run("renders -o out").err, HasSubstr("programs/train.py: expected the training's programs, found none"));
}

}  // namespace
}  // namespace fathom
