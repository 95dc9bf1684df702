// The numbers of pixels, written into them when they are large on the screen.
#pragma once

#include <QImage>
#include <QPainter>

#include "gui/seen.h"
#include "gui/viewport.h"

namespace fathom::gui {

inline constexpr double kPixelOfValues = 48;  // units of the screen that a pixel must have across

// A grid of lines between the pixels that `screen` shows, and in each its values; `image` has their colours, pixel by
// pixel of `seen`, and decides whether the writing is light or dark.
void paintPixelValues(QPainter& painter, const Viewport& viewport, const QRectF& screen, const Seen& seen,
                      const QImage& image);

}  // namespace fathom::gui
