#include "gui/depth_painting.h"

#include <algorithm>
#include <cmath>

namespace fathom::gui {

namespace {

constexpr double kDimmed = 0.5;  // opacity of what lies over the part that is left out

}  // namespace

QString depthText(double depth) {
  return QString::number(std::abs(depth) < 1e-12 ? 0 : depth, 'g', 5);
}

QColor between(const QPalette& palette, double part) {
  const QColor from = palette.color(QPalette::Base), to = palette.color(QPalette::Text);
  const auto mix = [&](float a, float b) { return a + float(part) * (b - a); };
  return QColor::fromRgbF(mix(from.redF(), to.redF()), mix(from.greenF(), to.greenF()), mix(from.blueF(), to.blueF()));
}

void paintClip(QPainter& painter, const QRectF& area, Qt::Orientation along, const deep::DepthAxis& axis,
               const deep::DepthRange& clip, const QPalette& palette, const std::function<double(double)>& at) {
  if (clip.isAll()) return;
  const auto inside = [&](double depth) { return std::clamp(depth, axis.near, axis.far); };
  const auto slab = [&](double from, double to) {
    QRectF part = area;
    const double a = at(inside(from)), b = at(inside(to));
    if (along == Qt::Horizontal) {
      part.setLeft(std::min(a, b));
      part.setRight(std::max(a, b));
    } else {
      part.setTop(std::min(a, b));
      part.setBottom(std::max(a, b));
    }
    return part;
  };
  QColor dim = palette.color(QPalette::Base);
  dim.setAlphaF(float(kDimmed));
  const double near = double(clip.near), far = std::max(double(clip.far), near);
  if (clip.inverted) {
    painter.fillRect(slab(near, far), dim);
  } else {
    painter.fillRect(slab(axis.near, near), dim);
    painter.fillRect(slab(far, axis.far), dim);
  }
  painter.setPen(QPen(palette.color(QPalette::Highlight), 1.5));
  for (const double plane : {near, far}) {
    if (!(plane >= axis.near && plane <= axis.far)) continue;
    const double place = at(plane);
    if (along == Qt::Horizontal)
      painter.drawLine(QPointF(place, area.top()), QPointF(place, area.bottom()));
    else
      painter.drawLine(QPointF(area.left(), place), QPointF(area.right(), place));
  }
}

}  // namespace fathom::gui
