// The attributes of a file as text, and back with their types: what `flat::Image` carries from read to write.
#pragma once

#include <OpenImageIO/imageio.h>

#include <map>
#include <string>

namespace fathom::flat {

// Text keeps the type: "3" is an int, "3.0" a float, "1.0, 2.0" a vector of floats (2 to 4, or matrices of 9 and 16),
// all else a string; a string that would read as one of the former stands in quotes. What describes the encoding of the
// file is left out.
std::map<std::string, std::string> attributesOf(const OIIO::ImageSpec& spec);

void addAttributes(const std::map<std::string, std::string>& attributes, OIIO::ImageSpec& spec);

}  // namespace fathom::flat
