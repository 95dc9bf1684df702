// Small words on pictures: capital letters, digits and some signs, in a font of 3 x 5 dots.
#pragma once

#include <array>
#include <string_view>

#include "flat/image.h"

namespace fathom::flat {

// Size in pixels of a text drawn with dots of `dot` x `dot` pixels.
int labelWidth(std::string_view text, int dot);
int labelHeight(int dot);

// Draws `text` into R, G, B with its upper left corner at (x, y) of the data window's coordinates; what is outside is
// cut off, and characters without a picture are left blank. Small letters become capitals.
void drawLabel(Image& image, int x, int y, std::string_view text, int dot, const std::array<float, 3>& colour);

// Fills a part of R, G, B with one colour.
void fillBox(Image& image, const Box& box, const std::array<float, 3>& colour);

}  // namespace fathom::flat
