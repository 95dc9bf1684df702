// The attributes of a deep part in the form that flat images carry.
#pragma once

#include <map>
#include <string>

#include "deep/attributes.h"

namespace fathom::deep {

// Numbers, vectors, matrices and strings, as the text that flat/io reads their types from; other types are left out,
// and so is what describes the encoding of the file.
std::map<std::string, std::string> flatAttributes(const Attributes& attributes);

}  // namespace fathom::deep
