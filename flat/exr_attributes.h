// The attributes of a flat image in an EXR header.
#pragma once

#include <OpenEXR/ImfHeader.h>

#include <map>
#include <string>

namespace fathom::flat {

// Numbers, vectors of two and three, matrices, chromaticities and strings, under the names that EXR has for what
// OpenImageIO names otherwise. What a header always has, such as its windows, stays where the text is of another type.
void addAttributes(const std::map<std::string, std::string>& attributes, Imf::Header& header);

}  // namespace fathom::flat
