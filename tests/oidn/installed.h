// Where tests find Open Image Denoise, and the stand-ins for its library.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

namespace fathom::reference {

// The folder that tests/oidn/install.sh makes.
inline const std::string kOidn = FATHOM_TEST_OIDN "/pyoidn/oidn";

// A stand-in of tests/oidn/fake.cpp by its target.
inline std::string fakeOidn(const std::string& name) {
  return std::string(FATHOM_FAKE_OIDN "/lib") + name + ".so";
}

// For tests that need the library. CTest installs it before suites whose names have "WithOidn" in them.
class WithOidnInstalled : public testing::Test {
 protected:
  void SetUp() override {
#ifdef __SANITIZE_THREAD__
    GTEST_SKIP() << "ThreadSanitizer cannot see how the library's threads wait for one another";
#endif
    if (!std::filesystem::exists(kOidn))
      GTEST_SKIP() << "Open Image Denoise is not installed: tests/oidn/install.sh " FATHOM_TEST_OIDN;
  }
};

}  // namespace fathom::reference
