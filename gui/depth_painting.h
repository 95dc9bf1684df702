// What drawings over depth have in common.
#pragma once

#include <QPainter>
#include <QPalette>
#include <functional>

#include "deep/clip_view.h"
#include "deep/depth_axis.h"

namespace fathom::gui {

// Few digits, enough to tell ticks apart.
QString depthText(double depth);

// A colour between the background and the text; `part` 1: the text.
QColor between(const QPalette& palette, double part);

// Dims what `clip` leaves out, and draws its planes. `at` maps a depth to a coordinate inside of `area`: across, or up
// and down. Planes that are infinite or beyond the axis have no line.
void paintClip(QPainter& painter, const QRectF& area, Qt::Orientation along, const deep::DepthAxis& axis,
               const deep::DepthRange& clip, const QPalette& palette, const std::function<double(double)>& at);

}  // namespace fathom::gui
