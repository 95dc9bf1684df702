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
    for (const char* c = e.what(); *c; ++c)
      expect(static_cast<unsigned char>(*c) >= 0x20 && *c != 0x7f, "an error without control characters");
  }
}

}  // namespace fathom::fuzz
