#include "flat/heatmap.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "flat/label.h"

namespace fathom::flat {

namespace {

using Colour = std::array<float, 3>;

constexpr Colour kNotFinite = {0, 1, 1}, kPaper = {0.12f, 0.12f, 0.12f}, kInk = {0.9f, 0.9f, 0.9f};
constexpr int kBarHeight = 8, kGap = 4;

float position(float error) {
  return std::clamp(std::log(error / kHeatmapLow) / std::log(kHeatmapHigh / kHeatmapLow), 0.0f, 1.0f);
}

void setPixel(Image& image, int x, int y, const Colour& colour) {
  for (size_t c = 0; c < 3; ++c) image.planes[c].values[image.dataWindow.index(x, y)] = colour[c];
}

// A bar over the whole width, with ticks and the errors that they mean.
void drawScale(Image& image, int top, int dot) {
  const int width = image.dataWindow.width();
  for (int x = 0; x < width; ++x)
    fillBox(image, {x, top + kGap, x + 1, top + kGap + kBarHeight},
            heatColour(float(x) / float(std::max(1, width - 1))));
  struct Tick {
    float error;
    std::string_view text;
  };
  for (const auto& [error, text] :
       {Tick{0.01f, "1%"}, Tick{0.03f, "3%"}, Tick{0.1f, "10%"}, Tick{0.3f, "30%"}, Tick{1, "100%"}}) {
    const int x = int(position(error) * float(width - 1));
    const int left = std::clamp(x - labelWidth(text, dot) / 2, 1, std::max(1, width - 1 - labelWidth(text, dot)));
    fillBox(image, {x, top + kGap + kBarHeight, x + 1, top + 2 * kGap + kBarHeight - 1}, kInk);
    drawLabel(image, left, top + 2 * kGap + kBarHeight, text, dot, kInk);
  }
}

}  // namespace

Colour heatColour(float t) {
  // Ours: CIE lightness 0, 17, 41, 68, 97.
  constexpr std::array<Colour, 5> stops = {
      {{0, 0, 0}, {0.26f, 0.07f, 0.42f}, {0.75f, 0.16f, 0.34f}, {0.97f, 0.55f, 0.14f}, {1, 0.98f, 0.72f}}};
  const float at = std::clamp(t, 0.0f, 1.0f) * float(stops.size() - 1);
  const size_t first = std::min(size_t(at), stops.size() - 2);
  const float part = at - float(first);
  Colour result;
  for (size_t c = 0; c < 3; ++c) result[c] = (1 - part) * stops[first][c] + part * stops[first + 1][c];
  return result;
}

Image heatmap(const Plane& errors, const Box& window) {
  const int width = window.width(), height = window.height();
  const int dot = std::clamp(width / 256, 1, 4);
  const Box all = {0, 0, width, height + 3 * kGap + kBarHeight + labelHeight(dot)};
  Image image{all, all, {}, {}};
  for (size_t c = 0; c < 3; ++c) image.add(std::string(1, "RGB"[c]), kPaper[c]);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const float error = errors.values[size_t(y) * size_t(width) + size_t(x)];
      setPixel(image, x, y, std::isnan(error) ? kNotFinite : heatColour(position(error)));
    }
  drawScale(image, height, dot);
  return image;
}

}  // namespace fathom::flat
