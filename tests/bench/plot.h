// A picture of error against time, as SVG.
#pragma once

#include <string>
#include <vector>

namespace fathom::bench {

struct Point {
  std::string name;
  double x, y;  // both > 0
};

// Points with their names in a frame whose axes are both logarithmic.
void writeLogPlot(const std::string& path, const std::string& xTitle, const std::string& yTitle,
                  const std::vector<Point>& points);

}  // namespace fathom::bench
