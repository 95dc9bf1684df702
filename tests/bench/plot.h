// A picture of error against time: points with their names, both axes logarithmic; as SVG and as PNG.
#pragma once

#include <string>
#include <vector>

#include "flat/image.h"

namespace fathom::bench {

struct Point {
  std::string name;
  double x, y;     // both > 0; others are left out
  int series = 0;  // decides the colour: 0 to 3
};

struct Plot {
  std::string title, xTitle, yTitle;
  std::vector<Point> points;
  std::vector<std::string> series = {};  // their names; empty: no legend
};

// The points than which none of the same series has less of the one and no more of the other, by x.
std::vector<Point> front(const std::vector<Point>& points, int series);

// A series' points that nothing beats are joined by a line.
std::string svgOf(const Plot& plot);
// The same, R G B as a display shows them; names in capitals.
flat::Image imageOf(const Plot& plot);

// What XML needs in the place of & < > ".
std::string escaped(const std::string& text);

void writeSvg(const std::string& path, const Plot& plot);
void writePng(const std::string& path, const Plot& plot);

}  // namespace fathom::bench
