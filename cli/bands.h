// A deep file in bands of rows, so that a frame larger than memory passes through a command.
#pragma once

#include <functional>
#include <string>

#include "deep/io.h"

namespace fathom::cli {

// Calls body with one band of the part after the other, from the top, each of about 256 MB at most when decoded, and
// of one row (or of one row of tiles) at least. An Error that the body throws is put behind the name of the file.
void forEachBand(const std::string& path, deep::Reader& reader, const std::function<void(deep::DeepImage band)>& body);

// The same windows, attributes and channels without rows: what a command makes of it is the layout of its output.
deep::DeepImage readLayout(deep::Reader& reader);

// How the part was stored, and the file's other parts, for an output that replaces it.
deep::WriteOptions likeInput(const std::string& path, const deep::PartInfo& part);

}  // namespace fathom::cli
