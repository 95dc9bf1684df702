// How fast this machine denoises, from a small frame that is always the same.
#pragma once

namespace fathom::cli {

// The seconds that the deep filter takes for it at --quality balanced, on as many threads as oneTBB may use: the least of a
// few runs, a few tenths of a second together.
double calibrationSeconds();

}  // namespace fathom::cli
