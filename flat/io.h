// Flat images in and out: read through OpenImageIO, EXR chiefly, and what else it knows by extension; written as EXR
// (flat/exr_writer) and 8-bit PNG.
//
// Errors (fathom::Error) name the file, the part, what was expected and what was found. Any bytes as input end in an
// image or an Error; the size that the header promises is checked against the limit before anything of that size is
// allocated.
#pragma once

#include <cstddef>
#include <string>

#include "flat/image.h"

namespace fathom::flat {

struct ReadOptions {
  std::string part = {};                 // number or name; empty: the first flat part
  size_t memoryLimit = size_t(8) << 30;  // bytes that the decoded image may take
};

// All channels as float (UINT ones by value, exact up to 2^22), by their full names, in the file's order.
Image read(const std::string& path, const ReadOptions& options = {});

struct WriteOptions {
  bool half = false;  // HALF channels; depths, counts, variances and Cryptomatte layers need the range and stay FLOAT
};

// Writes a zip-compressed EXR with all planes and attributes. It stands at `path` only when complete.
void write(const std::string& path, const Image& image, const WriteOptions& options = {});

// Writes R, G, B (or Y alone) of the data window as an 8-bit PNG: display values, clamped to [0,1] and rounded.
void writePng(const std::string& path, const Image& image);

}  // namespace fathom::flat
