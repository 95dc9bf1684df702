#include "tests/bench/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "flat/error.h"

namespace fathom::bench {
namespace {

constexpr double kWidth = 640, kHeight = 400, kLeft = 70, kRight = 100, kTop = 20, kBottom = 50;

// A logarithmic axis from pixel `from` to pixel `to`, a little longer than its values need.
struct Axis {
  double low, high, from, to;

  Axis(const std::vector<double>& values, double first, double last) : from(first), to(last) {
    const auto [least, most] = std::minmax_element(values.begin(), values.end());
    low = *least / 1.5;
    high = *most * 1.5;
  }
  double at(double value) const { return from + (to - from) * std::log(value / low) / std::log(high / low); }
  // 1, 2 and 5 times the powers of ten that lie on the axis.
  std::vector<double> ticks() const {
    std::vector<double> result;
    const int last = int(std::floor(std::log10(high)));
    for (int exponent = int(std::floor(std::log10(low))); exponent <= last; ++exponent)
      for (const int digit : {1, 2, 5})
        if (const double tick = digit * std::pow(10, exponent); tick >= low && tick <= high) result.push_back(tick);
    return result;
  }
};

}  // namespace

void writeLogPlot(const std::string& path, const std::string& xTitle, const std::string& yTitle,
                  const std::vector<Point>& points) {
  std::vector<double> xs, ys;
  for (const Point& point : points) {
    xs.push_back(point.x);
    ys.push_back(point.y);
  }
  const double right = kWidth - kRight, bottom = kHeight - kBottom;
  const Axis x(xs, kLeft, right), y(ys, bottom, kTop);

  std::string svg = fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" width="{0}" height="{1}" font-family="sans-serif" font-size="12">
<rect width="{0}" height="{1}" fill="white"/>
)",
      kWidth, kHeight);
  const auto line = [&](double x1, double y1, double x2, double y2) {
    svg += fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"#ddd\"/>\n", x1, y1, x2, y2);
  };
  const auto text = [&](double at, double height, const char* anchor, const std::string& words, const char* more = "") {
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n", at, height, anchor, more,
                       words);
  };
  for (const double tick : x.ticks()) {
    line(x.at(tick), kTop, x.at(tick), bottom);
    text(x.at(tick), bottom + 18, "middle", fmt::format("{:g}", tick));
  }
  for (const double tick : y.ticks()) {
    line(kLeft, y.at(tick), right, y.at(tick));
    text(kLeft - 8, y.at(tick) + 4, "end", fmt::format("{:g}", tick));
  }
  text((kLeft + right) / 2, kHeight - 10, "middle", xTitle);
  text(15, (kTop + bottom) / 2, "middle", yTitle, " transform=\"rotate(-90 15 185)\"");
  for (const Point& point : points) {
    svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"#b33\"/>\n", x.at(point.x), y.at(point.y));
    text(x.at(point.x) + 8, y.at(point.y) + 4, "start", point.name);
  }
  svg += "</svg>\n";

  std::ofstream out(path);
  out << svg;
  if (!out.flush()) fail("{}: cannot be written", path);
}

}  // namespace fathom::bench
