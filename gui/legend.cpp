#include "gui/legend.h"

#include <algorithm>

#include "gui/false_colours.h"

namespace fathom::gui {

namespace {

constexpr int kLength = 220, kThickness = 10, kMargin = 10;

void paintTicks(QPainter& painter, const QRectF& bar, const FalseColours& colours) {
  const double height = painter.fontMetrics().height();
  for (const auto& [place, text] : colours.ticks) {
    const double x = bar.left() + place * bar.width();
    const double width = painter.fontMetrics().horizontalAdvance(text);
    const double left = std::clamp(x - width / 2, bar.left(), bar.right() - width);
    painter.drawLine(QPointF(x, bar.bottom()), QPointF(x, bar.bottom() + 3));
    painter.drawText(QRectF(left, bar.bottom() + 3, width + 1, height), Qt::AlignLeft, text);
  }
}

}  // namespace

void paintLegend(QPainter& painter, const QRectF& rect, const Rendered& shown) {
  const SeenPtr& seen = shown.seenA ? shown.seenA : shown.seenB;
  if (!seen) return;
  const FalseColours colours = falseColours(seen->layer, shown.request.state, comparisonOf(shown.request), shown.ends);
  if (colours.scale.empty()) return;
  const double text = painter.fontMetrics().height() + 4;
  const QRectF ground(rect.left() + kMargin, rect.bottom() - kMargin - kThickness - text - 12, kLength + 16,
                      kThickness + text + 12);
  painter.setPen(Qt::NoPen);
  painter.setBrush(QColor(0, 0, 0, 160));
  painter.drawRoundedRect(ground, 4, 4);
  const QRectF bar(ground.left() + 8, ground.top() + 8, kLength, kThickness);
  QImage strip(int(colours.scale.size()), 1, QImage::Format_RGB32);
  std::ranges::copy(colours.scale, reinterpret_cast<QRgb*>(strip.scanLine(0)));
  painter.setRenderHint(QPainter::SmoothPixmapTransform);
  painter.drawImage(bar, strip);
  painter.setPen(QColor(225, 225, 225));
  paintTicks(painter, bar, colours);
}

}  // namespace fathom::gui
