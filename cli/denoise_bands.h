// How a frame is cut so that work on it stays within the memory.
#pragma once

#include <vector>

#include "cli/band.h"
#include "cli/denoise_plan.h"

namespace fathom::cli {

// The whole frame where it fits `memory` bytes, else as few bands as possible of as many rows each, so that each fits with
// `halo` more rows on both sides. Throws Error where a row does not fit, or a frame of a plan that needs it whole: its
// text says how much memory would do.
std::vector<Band> planBands(FrameSource& source, const SequencePlan& plan, int halo, size_t memory);

}  // namespace fathom::cli
