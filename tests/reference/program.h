// The program run as a user runs it, for tests.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

namespace fathom {

struct Outcome {
  int status = -1;  // exit status, or 1000 + the signal that ended it
  std::string out, err;
};

inline std::string contentsOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

// `fathom ARGUMENTS`, through the shell, in `folder`; `before` is a piece of shell that comes first.
inline Outcome runFathom(const std::string& folder, const std::string& arguments, const std::string& before = "") {
  const std::string command = fmt::format("cd '{0}' && {{ {1} exec '{2}' {3} >'{0}/stdout' 2>'{0}/stderr'; }}", folder,
                                          before, FATHOM_BINARY, arguments);
  const int status = std::system(command.c_str());
  Outcome outcome;
  outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
  outcome.out = contentsOf(folder + "/stdout");
  outcome.err = contentsOf(folder + "/stderr");
  return outcome;
}

}  // namespace fathom
