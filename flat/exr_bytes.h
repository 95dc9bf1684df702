// The bytes of an EXR file's head, as OpenEXR writes headers.
#pragma once

#include <OpenEXR/ImfHeader.h>

#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace fathom {

using Bytes = std::vector<uint8_t>;

// Room for `size` more bytes at the end.
inline uint8_t* grow(Bytes& bytes, size_t size) {
  bytes.resize(bytes.size() + size);
  return bytes.data() + bytes.size() - size;
}

template <class T>
void put(Bytes& to, const T& value) {
  std::memcpy(grow(to, sizeof(T)), &value, sizeof(T));
}

// HALF values, rounded to nearest as Imath does; finite ones beyond what HALF holds become its largest, 65504.
void putHalf(std::span<const float> values, uint8_t* to);

void putHeader(Bytes& to, const Imf::Header& header, bool tiled);

// Whether a name is longer than the format's first version allows.
bool hasLongNames(const Imf::Header& header);

}  // namespace fathom
