// What reading a flat file that should be refused says.
#pragma once

#include <string>

#include "base/error.h"
#include "flat/io.h"

namespace fathom::reference {

// The message of the Error; empty where the file is read.
inline std::string errorOf(const std::string& path, const flat::ReadOptions& options = {}) {
  try {
    flat::read(path, options);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

}  // namespace fathom::reference
