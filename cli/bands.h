// A deep file in bands of rows, so that a frame larger than memory passes through a command.
#pragma once

#include <functional>
#include <string>

#include "base/error.h"
#include "deep/io.h"

namespace fathom::cli {

// Calls body with one band of rows after the other, from the top; each takes at most `bandBytes` where more than one
// row (or one row of tiles) does.
void forEachBand(deep::Reader& reader, const std::function<void(deep::DeepImage band)>& body,
                 size_t bandBytes = size_t(256) << 20);

// The same windows, attributes and channels without rows: what a command makes of it is the layout of its output.
deep::DeepImage readLayout(deep::Reader& reader);

// How the part was stored, and the file's other parts, for an output that replaces it.
deep::WriteOptions likeInput(const std::string& path, const deep::PartInfo& part);

// What the operation returns; an Error of its own is put behind the name of the file that it works on.
template <class Operation>
auto about(const std::string& path, const Operation& operation) {
  try {
    return operation();
  } catch (const Error& e) {
    fail("{}: {}", path, e.what());
  }
}

}  // namespace fathom::cli
