// What EXR files of both kinds are made of.
#pragma once

namespace fathom {

enum class PixelType { Half, Float, Uint };

enum class Compression { None, Rle, Zips, Zip, Other };  // deep parts know the first three

}  // namespace fathom
