// What false colours mean: a bar of them with numbers.
#pragma once

#include <QPainter>

#include "gui/compositor.h"

namespace fathom::gui {

// In the lower left corner of `rect`; nothing where colours are what they are.
void paintLegend(QPainter& painter, const QRectF& rect, const Rendered& shown);

}  // namespace fathom::gui
