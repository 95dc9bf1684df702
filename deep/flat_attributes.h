// The attributes of a deep part in the form that flat images carry, and back.
#pragma once

#include <map>
#include <string>

#include "deep/attributes.h"

namespace fathom::deep {

// Numbers, vectors, matrices and strings, as the text that flat/io reads their types from; other types are left out,
// and so is what describes the encoding of the file.
std::map<std::string, std::string> flatAttributes(const Attributes& attributes);

// The way back: numbers, vectors of two and three, matrices, chromaticities and strings. What a deep part always has,
// such as its windows, stays as in a new part where the text is of another type.
Attributes deepAttributes(const std::map<std::string, std::string>& attributes);

}  // namespace fathom::deep
