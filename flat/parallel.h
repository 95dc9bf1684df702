// Rows in parallel. Work is cut into fixed tiles that do not depend on the number of threads, so results do not either.
#pragma once

#include <tbb/parallel_for.h>

namespace fathom {

// Calls body(first, last) on consecutive ranges of at most `grain` indices that cover [begin, end).
template <class Body>
void parallelRanges(int begin, int end, int grain, const Body& body) {
  const int tiles = end > begin ? (end - begin - 1) / grain + 1 : 0;
  tbb::parallel_for(0, tiles, [&](int tile) {
    const int first = begin + tile * grain;
    body(first, first + grain < end ? first + grain : end);
  });
}

// Calls body(i) for every index in [begin, end).
template <class Body>
void parallelFor(int begin, int end, const Body& body) {
  tbb::parallel_for(begin, end, body);
}

}  // namespace fathom
