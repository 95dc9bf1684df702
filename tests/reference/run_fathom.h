// Runs the program as a user does, and keeps what it printed.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/reference/temporary_folder.h"

namespace fathom {

struct Ran {
  int status = -1;  // of exit; -1: it did not exit by itself
  std::string out, err;
};

inline std::string textOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// `arguments` as typed into a shell; `before` is what was typed before, such as "cd folder;". Open Image Denoise is not found
// unless that says where it is, whatever this system has.
inline Ran runFathom(const std::string& arguments, const std::string& before = "") {
  const TemporaryFolder folder("output");
  const std::string command = "export FATHOM_OIDN_LIBRARY=/nowhere; " + before + " " + FATHOM_BINARY + " " + arguments +
                              " >'" + (folder / "out") + "' 2>'" + (folder / "err") + "'";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, textOf(folder / "out"), textOf(folder / "err")};
}

}  // namespace fathom
