// What decoding an EXR file would take, from its headers alone.
#pragma once

#include <cstddef>
#include <string>

namespace fathom::flat {

// Whether the file begins as every EXR file does; an Error where it cannot be read.
bool isExr(const std::string& path);

// Throws Error when the headers of an EXR file are broken, or when a part of it, decoded to floats, takes more than
// `limit` bytes. Nothing of that size is allocated. OpenImageIO allocates rows while it opens a file: this comes first.
void checkExrSize(const std::string& path, size_t limit);

}  // namespace fathom::flat
