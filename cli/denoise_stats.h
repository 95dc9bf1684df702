// What a run of `fathom denoise` did, as JSON.
#pragma once

#include <string>
#include <vector>

#include "cli/denoise_sequence.h"

namespace fathom::cli {

// Per frame the seconds by stage and the counts, their totals, and the peak memory in bytes. `planSeconds` is what was
// spent before the first frame, its reading included.
void writeStats(const std::string& path, const std::vector<DenoiseFrame>& frames,
                const std::vector<FrameReport>& reports, double planSeconds);

}  // namespace fathom::cli
