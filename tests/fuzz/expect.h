// What every fuzzer holds its subject to.
#pragma once

#include <cstdio>
#include <cstdlib>

#include "base/error.h"

namespace fathom::fuzz {

// Ends the program where something that always holds does not.
inline void expect(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "expected: %s\n", what);
  std::abort();
}

// Runs `body`, which may throw an Error of one line and nothing else.
template <class Body>
void mayFail(const Body& body) {
  try {
    body();
  } catch (const Error& e) {
    if (printable(e.what()) != e.what()) {
      std::fprintf(stderr, "expected: an error without control characters, found: %s\n", e.what());
      std::abort();
    }
  }
}

}  // namespace fathom::fuzz
