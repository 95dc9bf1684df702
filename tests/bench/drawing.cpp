#include "tests/bench/drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flat/label.h"
#include "tests/bench/plot.h"

namespace fathom::bench {
namespace {

constexpr int kScale = 2;  // of the image
constexpr int kDot = 3;    // of its letters: 4 dots a letter, as wide as in the other form

std::string hex(const Colour& colour) {
  const auto byte = [](float value) { return int(std::lround(255 * value)); };
  return fmt::format("#{:02x}{:02x}{:02x}", byte(colour[0]), byte(colour[1]), byte(colour[2]));
}

const char* svgAnchor(Anchor anchor) {
  if (anchor == Anchor::Start) return "start";
  return anchor == Anchor::Middle ? "middle" : "end";
}

void square(flat::Image& image, double x, double y, double radius, const Colour& colour) {
  const int x0 = int(std::lround(x - radius)), y0 = int(std::lround(y - radius));
  const int side = std::max(1, int(std::lround(2 * radius)));
  flat::fillBox(image, {x0, y0, x0 + side, y0 + side}, colour);
}

void draw(flat::Image& image, const Line& line) {
  const double dx = line.x1 - line.x0, dy = line.y1 - line.y0;
  const int steps = int(std::ceil(kScale * std::max(std::abs(dx), std::abs(dy)))) + 1;
  for (int i = 0; i <= steps; ++i) {
    const double t = double(i) / steps;
    square(image, kScale * (line.x0 + t * dx), kScale * (line.y0 + t * dy), 1, line.colour);
  }
}

void draw(flat::Image& image, const Disc& disc) {
  const double radius = kScale * disc.radius;
  const int top = int(std::lround(kScale * disc.y - radius)), rows = int(std::lround(2 * radius));
  for (int row = 0; row < rows; ++row) {
    const double above = row + 0.5 - radius, half = std::sqrt(std::max(0.0, radius * radius - above * above));
    const int y = top + row, x = int(std::lround(kScale * disc.x - half));
    flat::fillBox(image, {x, y, x + int(std::lround(2 * half)), y + 1}, disc.colour);
  }
}

void draw(flat::Image& image, const Text& text) {
  if (text.upright) return;
  const int width = flat::labelWidth(text.words, kDot);
  int x = int(std::lround(kScale * text.x));
  if (text.anchor == Anchor::Middle) x -= width / 2;
  if (text.anchor == Anchor::End) x -= width;
  const int y = int(std::lround(kScale * text.y)) - flat::labelHeight(kDot);
  flat::drawLabel(image, x, y, text.words, kDot, text.colour);
}

}  // namespace

double widthOf(const std::string& words) {
  return double(flat::labelWidth(words, kDot)) / kScale;
}

std::string toSvg(const Drawing& drawing) {
  std::string svg = fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" width="{0}" height="{1}" font-family="sans-serif" font-size="11">
<rect width="{0}" height="{1}" fill="white"/>
)",
      drawing.width, drawing.height);
  for (const Line& line : drawing.lines)
    svg += fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"{}\"/>\n", line.x0, line.y0, line.x1, line.y1,
                       hex(line.colour));
  for (const Disc& disc : drawing.discs)
    svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"{}\"/>\n", disc.x, disc.y, disc.radius,
                       hex(disc.colour));
  for (const Text& text : drawing.texts) {
    const std::string turn =
        text.upright ? fmt::format(" transform=\"rotate(-90 {:.1f} {:.1f})\"", text.x, text.y) : "";
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" fill=\"{}\"{}>{}</text>\n", text.x, text.y,
                       svgAnchor(text.anchor), hex(text.colour), turn, escaped(text.words));
  }
  return svg + "</svg>\n";
}

flat::Image toImage(const Drawing& drawing) {
  const Box window{0, 0, kScale * drawing.width, kScale * drawing.height};
  flat::Image image{window, window, {}, {}};
  for (const char* name : {"R", "G", "B"}) image.add(name, 1);
  for (const Line& line : drawing.lines) draw(image, line);
  for (const Disc& disc : drawing.discs) draw(image, disc);
  for (const Text& text : drawing.texts) draw(image, text);
  return image;
}

}  // namespace fathom::bench
