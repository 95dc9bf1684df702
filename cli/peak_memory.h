// The most memory that this process has held at once.
#pragma once

#include <sys/resource.h>

#include <cstdint>

namespace fathom::cli {

inline int64_t peakMemory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return int64_t(usage.ru_maxrss) * 1024;
}

}  // namespace fathom::cli
