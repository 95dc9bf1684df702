#include "flat/exr_bytes.h"

#include <Imath/half.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfIO.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fathom {

namespace {

constexpr float kLargestHalf = 65504;

// What OpenEXR writes a header to.
class HeaderBytes : public Imf::OStream {
 public:
  explicit HeaderBytes(Bytes& bytes) : OStream("header"), bytes_(bytes) {}
  void write(const char c[], int n) override { std::memcpy(grow(bytes_, size_t(n)), c, size_t(n)); }
  uint64_t tellp() override { return bytes_.size(); }
  void seekp(uint64_t) override { throw std::logic_error("a header is written in order"); }

 private:
  Bytes& bytes_;
};

}  // namespace

void putHalf(std::span<const float> values, uint8_t* to) {
  for (size_t i = 0; i < values.size(); ++i) {
    const float value = std::isfinite(values[i]) ? std::clamp(values[i], -kLargestHalf, kLargestHalf) : values[i];
    const uint16_t bits = imath_float_to_half(value);
    std::memcpy(to + 2 * i, &bits, sizeof(bits));
  }
}

void putHeader(Bytes& to, const Imf::Header& header, bool tiled) {
  HeaderBytes stream(to);
  header.writeTo(stream, tiled);
}

bool hasLongNames(const Imf::Header& header) {
  constexpr size_t kShort = 31;
  const auto isLong = [](const char* name) { return std::strlen(name) > kShort; };
  for (auto a = header.begin(); a != header.end(); ++a)
    if (isLong(a.name()) || isLong(a.attribute().typeName())) return true;
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c)
    if (isLong(c.name())) return true;
  return false;
}

}  // namespace fathom
