// The attributes of an OpenImageIO header, as flat images carry them.
#pragma once

#include <OpenImageIO/imageio.h>

#include <map>
#include <string>

namespace fathom::flat {

// Numbers, vectors, matrices and strings, in the form of flat/attribute_text. What describes the encoding of the file
// is left out.
std::map<std::string, std::string> attributesOf(const OIIO::ImageSpec& spec);

}  // namespace fathom::flat
