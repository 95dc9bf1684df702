// See base/parallel_threads.h.
#pragma once

#include "base/parallel_threads.h"  // IWYU pragma: export
