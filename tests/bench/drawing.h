// A drawing of few things, to be written in either form of picture.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "flat/image.h"

namespace fathom::bench {

using Colour = std::array<float, 3>;

enum class Anchor { Start, Middle, End };

// Lengths in pixels from the upper left corner, colours as a display takes them.
struct Line {
  double x0, y0, x1, y1;
  Colour colour;
};
struct Disc {
  double x, y, radius;
  Colour colour;
};
struct Text {
  double x, y;  // of the baseline
  Anchor anchor;
  std::string words;
  Colour colour;
  bool upright = false;  // from below to above
};

struct Drawing {
  int width, height;
  std::vector<Line> lines;
  std::vector<Disc> discs;
  std::vector<Text> texts;
};

std::string toSvg(const Drawing& drawing);
// Twice the size in both directions; upright words are left out.
flat::Image toImage(const Drawing& drawing);

// How wide words are drawn, about.
double widthOf(const std::string& words);

}  // namespace fathom::bench
