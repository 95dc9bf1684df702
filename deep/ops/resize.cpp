#include "deep/ops/resize.h"

#include <cmath>

#include "base/error.h"

namespace fathom::deep {

namespace {

// Where the corner lands: near the place that it has in the scaled plane.
int cornerOf(int begin, int size, int newSize) {
  return int(std::lround(double(begin) * newSize / size));
}

void check(const Box& display, int width, int height, double tolerance) {
  if (width < 1 || height < 1) fail("resize: expected a size of at least 1 x 1, found {} x {}", width, height);
  if (display.empty()) fail("resize: expected a display window that is not empty, found one");
  if (!(tolerance >= 0)) fail("resize: expected a tolerance of at least 0, found {}", tolerance);
}

}  // namespace

Box resizedDisplay(const Box& display, int width, int height) {
  const int x = cornerOf(display.x0, display.width(), width), y = cornerOf(display.y0, display.height(), height);
  return {x, y, x + width, y + height};
}

Resampling resizing(const Box& display, int width, int height, Filter filter, double tolerance) {
  check(display, width, height, tolerance);
  const Box to = resizedDisplay(display, width, height);
  return {.columns = {double(display.x0), double(to.x0), double(display.width()), double(width)},
          .rows = {double(display.y0), double(to.y0), double(display.height()), double(height)},
          .filter = filter,
          .tolerance = tolerance};
}

DeepImage resize(DeepImage image, int width, int height, Filter filter, double tolerance) {
  const Box display = image.displayWindow;
  const Resampling how = resizing(display, width, height, filter, tolerance);
  if (const auto ppu = image.attributes.getFloat("fathom:ppuScale"))
    image.attributes.set("fathom:ppuScale", float(double(*ppu) * width / display.width()));
  DeepImage result = resample(std::move(image), how);
  result.displayWindow = resizedDisplay(display, width, height);
  return result;
}

}  // namespace fathom::deep
