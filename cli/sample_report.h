// All samples of one deep pixel as a table and as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::cli {

// One line about the pixel, then a table of its samples as stored: depths and alpha, effective alpha (`seen`), the
// transmittance in front (`front`) and the other channels. Samples stand below one another, or, where they are fewer than
// what there is to tell of each, beside one another. Errors are those of deep::lightOf.
std::vector<std::string> sampleTable(const deep::DeepImage& image, int x, int y);

// A number with as few digits as tell a FLOAT from its neighbours; one that is not finite is the string "nan", "inf" or
// "-inf".
nlohmann::json valueJson(float value);

// {x, y, alpha, samples: [{channels: {NAME: value}, seen, front}]}, values as valueJson gives them.
nlohmann::json sampleJson(const deep::DeepImage& image, int x, int y);

}  // namespace fathom::cli
