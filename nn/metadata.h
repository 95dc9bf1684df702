// What weight files say of themselves.
#pragma once

#include <string>

#include "nn/weights.h"

namespace fathom::nn {

// Throws an Error where the file has no such metadata.
const std::string& metadata(const WeightFile& file, const std::string& key);

// Throws an Error that names both where they differ.
void expectMetadata(const WeightFile& file, const std::string& key, const std::string& expected);

// Of the network's features: a multiple of 16 up to 256.
int widthOf(const WeightFile& file);

}  // namespace fathom::nn
