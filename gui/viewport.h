// Where a picture's pixels lie on the screen.
#pragma once

#include <QPoint>
#include <QPointF>
#include <QRectF>
#include <QSizeF>
#include <algorithm>
#include <cmath>

#include "flat/box.h"

namespace fathom::gui {

// Points of the picture are in its pixels, whose pixel (x, y) covers [x, x+1) x [y, y+1); points of the screen in a
// widget's coordinates.
struct Viewport {
  static constexpr double kSmallest = 1.0 / 128, kLargest = 512;

  double scale = 1;  // of a pixel on the screen
  QPointF origin;    // where the picture's (0, 0) is on the screen

  QPointF toScreen(QPointF picture) const { return picture * scale + origin; }
  QPointF toPicture(QPointF screen) const { return (screen - origin) / scale; }
  QRectF toScreen(const Box& box) const {
    return {toScreen(QPointF(box.x0, box.y0)), toScreen(QPointF(box.x1, box.y1))};
  }
  QPoint pixelAt(QPointF screen) const {
    const QPointF at = toPicture(screen);
    return {int(std::floor(at.x())), int(std::floor(at.y()))};
  }
  // The pixels that are seen at least in part.
  Box visible(QSizeF screen) const {
    const QPointF first = toPicture({0, 0}), last = toPicture({screen.width(), screen.height()});
    return {int(std::floor(first.x())), int(std::floor(first.y())), int(std::ceil(last.x())), int(std::ceil(last.y()))};
  }

  // What is at `fixed` on the screen stays there.
  Viewport scaledTo(double newScale, QPointF fixed) const {
    const double to = std::clamp(newScale, kSmallest, kLargest);
    return {to, fixed - toPicture(fixed) * to};
  }
  // All of `box` in the middle, as large as the screen lets it.
  static Viewport fitted(const Box& box, QSizeF screen) {
    if (box.empty() || screen.isEmpty()) return {};
    const double to =
        std::clamp(std::min(screen.width() / box.width(), screen.height() / box.height()), kSmallest, kLargest);
    const QPointF centre(0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1));
    return {to, QPointF(screen.width() / 2, screen.height() / 2) - centre * to};
  }
  bool operator==(const Viewport&) const = default;
};

}  // namespace fathom::gui
