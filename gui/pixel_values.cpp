#include "gui/pixel_values.h"

#include <QFontDatabase>
#include <QFontMetricsF>
#include <algorithm>

namespace fathom::gui {

namespace {

constexpr double kLargestFont = 14, kSmallestFont = 7;  // pixels

// Lines that fit into a cell: so many, of the length of a number with three digits.
QFont fittingFont(double cell, size_t lines) {
  QFont font = QFontDatabase::systemFont(QFontDatabase::FixedFont);
  const double byHeight = 0.85 * cell / (1.25 * double(std::max<size_t>(2, lines))), byWidth = 0.9 * cell / (8 * 0.62);
  font.setPixelSize(int(std::clamp(std::min(byHeight, byWidth), kSmallestFont, kLargestFont)));
  return font;
}

void paintGrid(QPainter& painter, const Viewport& viewport, const Box& box) {
  painter.setPen(QPen(QColor(128, 128, 128, 90), 0));
  const QRectF all = viewport.toScreen(box);
  for (int x = box.x0; x <= box.x1; ++x) {
    const double at = viewport.toScreen(QPointF(x, 0)).x();
    painter.drawLine(QPointF(at, all.top()), QPointF(at, all.bottom()));
  }
  for (int y = box.y0; y <= box.y1; ++y) {
    const double at = viewport.toScreen(QPointF(0, y)).y();
    painter.drawLine(QPointF(all.left(), at), QPointF(all.right(), at));
  }
}

QString inLines(const std::vector<NamedValue>& values) {
  QStringList lines;
  for (const NamedValue& value : values) lines << value.text;
  return lines.join('\n');
}

}  // namespace

void paintPixelValues(QPainter& painter, const Viewport& viewport, const QRectF& screen, const Seen& seen,
                      const QImage& image) {
  if (seen.step != 1 || image.width() != seen.width) return;
  const Viewport inside{viewport.scale, viewport.origin - screen.topLeft()};
  const Box box = intersect(seen.box, inside.visible(screen.size()));
  if (box.empty()) return;
  paintGrid(painter, viewport, box);
  const size_t lines = seen.values.size() + !seen.alpha.empty();
  painter.setFont(fittingFont(viewport.scale, lines));
  const int digits = viewport.scale >= 80 ? 4 : 3;
  for (int y = box.y0; y < box.y1; ++y)
    for (int x = box.x0; x < box.x1; ++x) {
      const QRgb under = image.pixel(x - seen.box.x0, y - seen.box.y0);
      painter.setPen(qGray(under) > 110 ? QColor(0, 0, 0, 220) : QColor(255, 255, 255, 200));
      painter.drawText(viewport.toScreen(Box{x, y, x + 1, y + 1}), Qt::AlignCenter,
                       inLines(namedValues(seen, size_t(seen.index({x, y})), digits)));
    }
}

}  // namespace fathom::gui
