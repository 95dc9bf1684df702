// See base/parallel.h.
#pragma once

#include "base/parallel.h"  // IWYU pragma: export
