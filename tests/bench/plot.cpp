#include "tests/bench/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "flat/io.h"
#include "tests/bench/drawing.h"
#include "tests/bench/measure.h"

namespace fathom::bench {
namespace {

constexpr int kWidth = 860, kHeight = 520;
constexpr double kLeft = 70, kRight = 130, kTop = 40, kBottom = 50, kLetter = 9;
constexpr Colour kInk{0.1f, 0.1f, 0.1f}, kGrid{0.87f, 0.87f, 0.87f};
constexpr std::array<Colour, 4> kColours = {
    {{0.7f, 0.15f, 0.15f}, {0.1f, 0.35f, 0.65f}, {0.15f, 0.5f, 0.2f}, {0.5f, 0.35f, 0.05f}}};

const Colour& colourOf(int series) {
  return kColours[size_t(series) % kColours.size()];
}

// A logarithmic axis from pixel `from` to pixel `to`, a little longer than its values need.
struct Axis {
  double low, high, from, to;

  Axis(const std::vector<double>& values, double first, double last) : from(first), to(last) {
    const auto [least, most] = std::minmax_element(values.begin(), values.end());
    low = *least / 1.5;
    high = *most * 1.5;
  }
  double at(double value) const { return from + (to - from) * std::log(value / low) / std::log(high / low); }
  // Those of 1, 2, 3, 5 and 7 times the powers of ten that lie on the axis.
  std::vector<double> ticks() const {
    std::vector<double> result;
    const int last = int(std::floor(std::log10(high)));
    for (int exponent = int(std::floor(std::log10(low))); exponent <= last; ++exponent)
      for (const int digit : {1, 2, 3, 5, 7})
        if (const double tick = digit * std::pow(10, exponent); tick >= low && tick <= high) result.push_back(tick);
    return result;
  }
};

struct Rectangle {
  double x0, y0, x1, y1;

  bool meets(const Rectangle& other) const { return x0 < other.x1 && other.x0 < x1 && y0 < other.y1 && other.y0 < y1; }
};

// Puts names beside their points, where they meet the fewest points and names.
class Names {
 public:
  explicit Names(const std::vector<Disc>& discs) {
    for (const Disc& disc : discs)
      taken_.push_back({disc.x - disc.radius, disc.y - disc.radius, disc.x + disc.radius, disc.y + disc.radius});
  }

  Text place(const Disc& disc, const std::string& words) {
    const double width = widthOf(words), gap = 1.8 * disc.radius, near = kLetter / 2;
    // Up to the right first: the lines between points that nothing beats fall.
    const std::array<Text, 6> places = {{{disc.x + near, disc.y - near, Anchor::Start, words, disc.colour},
                                         {disc.x + gap, disc.y + near, Anchor::Start, words, disc.colour},
                                         {disc.x - near, disc.y + gap + kLetter, Anchor::End, words, disc.colour},
                                         {disc.x - gap, disc.y + near, Anchor::End, words, disc.colour},
                                         {disc.x, disc.y - gap, Anchor::Middle, words, disc.colour},
                                         {disc.x, disc.y + gap + kLetter, Anchor::Middle, words, disc.colour}}};
    const auto boxOf = [&](const Text& text) {
      const double x0 =
          text.anchor == Anchor::Start ? text.x : text.x - (text.anchor == Anchor::End ? width : width / 2);
      return Rectangle{x0, text.y - kLetter, x0 + width, text.y};
    };
    const auto meetings = [&](const Text& text) {
      return std::ranges::count_if(taken_, [box = boxOf(text)](const Rectangle& other) { return box.meets(other); });
    };
    const Text& best =
        *std::ranges::min_element(places, [&](const Text& a, const Text& b) { return meetings(a) < meetings(b); });
    taken_.push_back(boxOf(best));
    return best;
  }

 private:
  std::vector<Rectangle> taken_;
};

bool isDrawn(const Point& point) {
  return point.x > 0 && point.y > 0 && std::isfinite(point.x) && std::isfinite(point.y);
}

void drawAxes(Drawing& drawing, const Plot& plot, const Axis& x, const Axis& y) {
  const double right = kWidth - kRight, bottom = kHeight - kBottom;
  for (const double tick : x.ticks()) {
    drawing.lines.push_back({x.at(tick), kTop, x.at(tick), bottom, kGrid});
    drawing.texts.push_back({x.at(tick), bottom + 18, Anchor::Middle, fmt::format("{:g}", tick), kInk});
  }
  for (const double tick : y.ticks()) {
    drawing.lines.push_back({kLeft, y.at(tick), right, y.at(tick), kGrid});
    drawing.texts.push_back({kLeft - 8, y.at(tick) + 4, Anchor::End, fmt::format("{:g}", tick), kInk});
  }
  drawing.texts.push_back({(kLeft + right) / 2, kHeight - 10.0, Anchor::Middle, plot.xTitle, kInk});
  drawing.texts.push_back({15, (kTop + bottom) / 2, Anchor::Middle, plot.yTitle, kInk, true});
  drawing.texts.push_back({kLeft, 18, Anchor::Start, plot.title, kInk});
  for (size_t i = 0; i < plot.series.size(); ++i)
    drawing.texts.push_back({right + 10, kTop + 10 + 16 * double(i), Anchor::Start, plot.series[i], colourOf(int(i))});
}

Drawing drawingOf(const Plot& plot) {
  std::vector<Point> points = plot.points;
  std::erase_if(points, [](const Point& point) { return !isDrawn(point); });
  Drawing drawing{kWidth, kHeight, {}, {}, {}};
  if (points.empty()) return drawing;
  std::vector<double> xs, ys;
  for (const Point& point : points) {
    xs.push_back(point.x);
    ys.push_back(point.y);
  }
  const Axis x(xs, kLeft, kWidth - kRight), y(ys, kHeight - kBottom, kTop);
  drawAxes(drawing, plot, x, y);
  for (int series = 0; series < int(kColours.size()); ++series) {
    const std::vector<Point> best = front(points, series);
    for (size_t i = 1; i < best.size(); ++i)
      drawing.lines.push_back(
          {x.at(best[i - 1].x), y.at(best[i - 1].y), x.at(best[i].x), y.at(best[i].y), colourOf(series)});
  }
  for (const Point& point : points) drawing.discs.push_back({x.at(point.x), y.at(point.y), 4, colourOf(point.series)});
  Names names(drawing.discs);
  for (size_t i = 0; i < points.size(); ++i) drawing.texts.push_back(names.place(drawing.discs[i], points[i].name));
  return drawing;
}

}  // namespace

std::vector<Point> front(const std::vector<Point>& points, int series) {
  std::vector<Point> sorted;
  for (const Point& point : points)
    if (point.series == series) sorted.push_back(point);
  std::ranges::sort(sorted, [](const Point& a, const Point& b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
  std::vector<Point> result;
  for (const Point& point : sorted)
    if (result.empty() || point.y < result.back().y) result.push_back(point);
  return result;
}

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += c;
    }
  return result;
}

std::string svgOf(const Plot& plot) {
  return toSvg(drawingOf(plot));
}

flat::Image imageOf(const Plot& plot) {
  return toImage(drawingOf(plot));
}

void writeSvg(const std::string& path, const Plot& plot) {
  writeText(path, svgOf(plot));
}

void writePng(const std::string& path, const Plot& plot) {
  flat::writePng(path, imageOf(plot));
}

}  // namespace fathom::bench
