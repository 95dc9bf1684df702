// Every extreme frame, over and over.
#pragma once

#include <string>

#include "tests/stress/extreme_deep.h"
#include "tests/stress/record.h"

namespace fathom::stress {

struct Frame {
  std::string name;
  ExtremeParams params;
  unsigned seed;
  deep::DeepImage image;
};

inline constexpr unsigned kSeeds = 8;  // of a round

// Calls body(frame) for all kinds of frames, with and without volumes.
template <class Body>
void forEachFrame(const Body& body) {
  for (const bool volumes : {true, false})
    for (const ExtremeCase& one : extremeCases(volumes))
      for (unsigned seed = 1; seed <= kSeeds * unsigned(rounds()); ++seed)
        body(Frame{one.name, one.params, seed, extremeDeep(one.params, seed)});
}

}  // namespace fathom::stress
