// What the stress tests leave for docs/stability.md: the worst error of each operation under each kind of stress.
#pragma once

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace fathom::stress {

// Appends a line to the file that FATHOM_STRESS_TABLE names, and does nothing without it: operation, stress, error and the
// bound that the test holds it to, tabs between. tests/stress/report.py keeps the largest error of equal names.
// Each test runs in a process of its own, several at once: a line is one write.
inline void record(const std::string& operation, const std::string& stress, double error, double bound) {
  const char* table = std::getenv("FATHOM_STRESS_TABLE");
  if (!table) return;
  char line[512];
  std::snprintf(line, sizeof line, "%s\t%s\t%.3g\t%.3g\n", operation.c_str(), stress.c_str(), error, bound);
  if (std::FILE* file = std::fopen(table, "a")) {
    std::fputs(line, file);
    std::fclose(file);
  }
}

// How often a test draws: 1 in the short version, more where FATHOM_STRESS_ROUNDS says so.
inline int rounds() {
  const char* wanted = std::getenv("FATHOM_STRESS_ROUNDS");
  return wanted ? std::max(1, std::atoi(wanted)) : 1;
}

}  // namespace fathom::stress
