// Rows in parallel. Work is cut into fixed tiles that do not depend on the number of threads, so results do not either.
#pragma once

#ifdef __SANITIZE_THREAD__
// ThreadSanitizer cannot see how tasks are handed over inside Debian's libtbb and takes every result for a race.
#include "base/parallel_threads.h"
#else
// The viewer's sources have a macro of Qt by the name of one of oneTBB's functions.
#pragma push_macro("emit")
#undef emit
#include <tbb/parallel_for.h>
#pragma pop_macro("emit")
#endif

namespace fathom {

// Calls body(i) for every index in [begin, end).
template <class Body>
void parallelFor(int begin, int end, const Body& body) {
#ifdef __SANITIZE_THREAD__
  forEachOnThreads(begin, end, body);
#else
  tbb::parallel_for(begin, end, body);
#endif
}

// Calls body(first, last) on consecutive ranges of at most `grain` indices that cover [begin, end).
template <class Body>
void parallelRanges(int begin, int end, int grain, const Body& body) {
  const int tiles = end > begin ? (end - begin - 1) / grain + 1 : 0;
  parallelFor(0, tiles, [&](int tile) {
    const int first = begin + tile * grain;
    body(first, first + grain < end ? first + grain : end);
  });
}

}  // namespace fathom
