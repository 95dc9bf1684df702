// What the network does with colours besides filtering them.
#pragma once

#include <cstddef>

#include "nn/blocked.h"

namespace fathom::nn {

// log(1 + v) of values of at least 0.
void logColour(const float* from, size_t count, Element element, std::byte* to);

// With m the sigmoid of the first three channels of `logits`, [pixels][block]: first = m colour, second = (1 - m) colour,
// [3][pixels] each.
void splitColour(const float* logits, int block, const float* colour, size_t pixels, float* first, float* second);

}  // namespace fathom::nn
