// Numbers about a deep image as lines for a reader and as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "deep/image.h"
#include "deep/ops/stats.h"
#include "deep/statistics.h"

namespace fathom::cli {

const char* typeName(deep::PixelType type);

// A label and what there is to say, indented.
std::string reportLine(const char* label, const std::string& text);

std::vector<std::string> statisticsLines(const deep::Statistics& statistics);
nlohmann::json statisticsJson(const deep::Statistics& statistics);

std::vector<std::string> statsLines(const deep::ImageStats& stats);
nlohmann::json statsJson(const deep::ImageStats& stats);

}  // namespace fathom::cli
