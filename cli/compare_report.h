// What `fathom compare` measured: as JSON, one object a frame, and as a table made from that.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "deep/compare.h"
#include "flat/metrics.h"

namespace fathom::cli {

// Measures by their names, an infinite one as null; of deep images those of the flattened image, per bin, and for each
// clip.
nlohmann::ordered_json toJson(const flat::Metrics& metrics);
nlohmann::ordered_json toJson(const deep::DeepMetrics& metrics);

// The mean of values of the same shape, number by number; null where one of them is null.
nlohmann::ordered_json meanOf(const std::vector<nlohmann::ordered_json>& values);

// Prints the measures of a frame, or their mean: {"flattened": ..., "bins": ..., "clips": [...]}, the last two for deep
// images.
void printTable(const nlohmann::ordered_json& frame);

// Prints what was left out of a frame's measures, and what the reference's own error has in them.
void printNotes(const nlohmann::ordered_json& frame, bool corrected);

}  // namespace fathom::cli
