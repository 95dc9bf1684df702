// See base/buffer.h.
#pragma once

#include "base/buffer.h"  // IWYU pragma: export
