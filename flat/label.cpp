#include "flat/label.h"

#include <algorithm>
#include <cctype>
#include <cstdint>

namespace fathom::flat {

namespace {

constexpr int kColumns = 3, kRows = 5;

// One number a character: bit 3 * row + column is a dot.
constexpr std::string_view kCharacters = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ.-+%_:/()=";
constexpr std::array<uint16_t, kCharacters.size()> kDots = {
    0x7b6f, 0x749a, 0x73e7, 0x79a7, 0x49ed, 0x79cf, 0x7bcf, 0x2527, 0x7bef, 0x79ef, 0x5bea, 0x3aeb,
    0x624e, 0x3b6b, 0x72cf, 0x12cf, 0x6b4e, 0x5bed, 0x7497, 0x2b24, 0x5aed, 0x7249, 0x5bfd, 0x5b6b,
    0x2b6a, 0x12eb, 0x6f6a, 0x5aeb, 0x388e, 0x2497, 0x7b6d, 0x2b6d, 0x5fed, 0x5aad, 0x24ad, 0x72a7,
    0x2000, 0x01c0, 0x05d0, 0x52a5, 0x7000, 0x0410, 0x12a4, 0x4494, 0x1491, 0x0e38};

uint16_t dotsOf(char c) {
  const size_t at = kCharacters.find(char(std::toupper(static_cast<unsigned char>(c))));
  return at == kCharacters.npos ? 0 : kDots[at];
}

}  // namespace

int labelWidth(std::string_view text, int dot) {
  return std::max(0, int(text.size()) * (kColumns + 1) - 1) * dot;
}

int labelHeight(int dot) {
  return kRows * dot;
}

void fillBox(Image& image, const Box& box, const std::array<float, 3>& colour) {
  const Box inside = intersect(box, image.dataWindow);
  constexpr std::array<const char*, 3> names = {"R", "G", "B"};
  for (size_t c = 0; c < 3; ++c) {
    Plane* plane = image.find(names[c]);
    for (int y = inside.y0; plane && y < inside.y1; ++y)
      for (int x = inside.x0; x < inside.x1; ++x) plane->values[image.dataWindow.index(x, y)] = colour[c];
  }
}

void drawLabel(Image& image, int x, int y, std::string_view text, int dot, const std::array<float, 3>& colour) {
  for (const char c : text) {
    const uint16_t dots = dotsOf(c);
    for (int row = 0; row < kRows; ++row)
      for (int column = 0; column < kColumns; ++column)
        if (dots >> (kColumns * row + column) & 1) {
          const int left = x + column * dot, top = y + row * dot;
          fillBox(image, {left, top, left + dot, top + dot}, colour);
        }
    x += (kColumns + 1) * dot;
  }
}

}  // namespace fathom::flat
