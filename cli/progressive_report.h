// What a run of `fathom progressive` estimated, as JSON.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/progressive_job.h"

namespace fathom::cli {

// Whether a pass is known to have reached the wanted error.
bool reaches(const PassReport& report, std::optional<double> target);

// Per pass the estimated relMSE of the render and the result, and per tile of the result; with a target, whether each
// has reached it, and the first pass that has.
void writeProgressiveReport(const std::string& path, const std::vector<PassReport>& reports,
                            std::optional<double> target);

}  // namespace fathom::cli
