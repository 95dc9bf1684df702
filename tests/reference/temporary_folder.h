// A folder of its own for one test (or for a part of one, by `name`), removed with it.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>

namespace fathom {

class TemporaryFolder {
 public:
  explicit TemporaryFolder(const std::string& name = {}) {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    std::string folder = std::string("fathom-") + test->test_suite_name() + "-" + test->name() + "-" + name + "-" +
                         std::to_string(::getpid());
    std::ranges::replace(folder, '/', '-');
    path_ = ::testing::TempDir() + "/" + folder;
    std::filesystem::create_directories(path_);
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::string& path() const { return path_; }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

}  // namespace fathom
