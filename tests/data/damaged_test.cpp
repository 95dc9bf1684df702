// The shared damaged files through info, flatten and denoise: an answer, or one line and exit status 1; no
// crash, no hang, bounded memory, and no output where there is no answer.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/reference/run_fathom.h"
#include "tests/reference/temporary_folder.h"

namespace fathom {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr const char* kMemory = "true";  // a sanitizer's own address space is beyond any limit
#else
constexpr const char* kMemory = "ulimit -v 6000000";  // kB
#endif

std::vector<std::string> damagedFiles() {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(FATHOM_SHARED "/damaged"))
    files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  return files;
}

std::string limited() {
  return std::string(kMemory) + "; exec timeout 20";
}

class DamagedFiles : public ::testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Data, DamagedFiles, ::testing::Values("flatten", "denoise"),
                         [](const auto& test) { return std::string(test.param); });

TEST_P(DamagedFiles, AreAnsweredOrRefusedInOneLine) {
  const TemporaryFolder folder;
  const std::vector<std::string> files = damagedFiles();
  ASSERT_EQ(files.size(), 92u);
  int refused = 0;
  for (const std::string& file : files) {
    const std::string output = folder / "out.exr";
    const Ran ran = runFathom(fmt::format("{} '{}' -o '{}'", GetParam(), file, output), limited());
    EXPECT_TRUE(ran.status == 0 || ran.status == 1) << file << " ends with " << ran.status << "\n" << ran.err;
    if (ran.status == 1) {
      ++refused;
      EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1) << file << "\n" << ran.err;
      EXPECT_EQ(ran.err.rfind("fathom: ", 0), 0u) << ran.err;
      EXPECT_FALSE(std::filesystem::exists(output)) << file;
    }
    std::filesystem::remove(output);
    EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << file;
  }
  EXPECT_GT(refused, 60);
}

TEST(DamagedFilesTogether, InfoTellsOfEachAndGoesOn) {
  std::string list;
  for (const std::string& file : damagedFiles()) list += " '" + file + "'";
  const Ran ran = runFathom("info --json" + list, limited());
  EXPECT_EQ(ran.status, 1);
  const auto answers = nlohmann::json::parse(ran.out);
  EXPECT_EQ(answers.size() + size_t(std::count(ran.err.begin(), ran.err.end(), '\n')), 92u);
  EXPECT_GT(answers.size(), 15u);  // headers that contradict themselves are refused before they are read
}

}  // namespace
}  // namespace fathom
