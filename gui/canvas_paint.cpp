// How the canvas draws what it has; canvas.cpp has what it does.
#include <QFileInfo>
#include <QPainter>
#include <cmath>

#include "gui/canvas.h"
#include "gui/legend.h"
#include "gui/pixel_values.h"

namespace fathom::gui {

namespace {

const QColor kAround(28, 28, 28), kFrame(110, 110, 110), kData(190, 190, 190, 140), kMark(255, 190, 60);

// The part of an image that can be seen, whose pixels are `size` across in the picture and begin at box's corner.
void paintImage(QPainter& painter, const Viewport& viewport, const QRectF& screen, const QImage& image, const Box& box,
                int size) {
  const auto toImage = [&](QPointF at) { return (viewport.toPicture(at) - QPointF(box.x0, box.y0)) / size; };
  const QPointF first = toImage(screen.topLeft()), last = toImage(screen.bottomRight());
  const QRect all(0, 0, image.width(), image.height());
  const QRect part = QRect(QPoint(int(std::floor(first.x())), int(std::floor(first.y()))),
                           QPoint(int(std::ceil(last.x())), int(std::ceil(last.y()))))
                         .intersected(all);
  if (part.isEmpty()) return;
  const auto toScreen = [&](QPoint at) { return viewport.toScreen(QPointF(at) * size + QPointF(box.x0, box.y0)); };
  const bool magnified = viewport.scale * size * painter.device()->devicePixelRatioF() >= 1;
  painter.setRenderHint(QPainter::SmoothPixmapTransform, !magnified);
  painter.drawImage(QRectF(toScreen(part.topLeft()), toScreen(part.bottomRight() + QPoint(1, 1))), image, part);
}

// Just outside of the window's pixels.
void paintOutline(QPainter& painter, const Viewport& viewport, const Box& box, const QColor& colour,
                  Qt::PenStyle style) {
  QPen pen(colour, 1, style);
  pen.setCosmetic(true);
  painter.setPen(pen);
  painter.setBrush(Qt::NoBrush);
  const double half = 0.5 / painter.device()->devicePixelRatioF();  // of a pixel of the screen, which the pen is wide
  painter.drawRect(viewport.toScreen(box).adjusted(-half, -half, half, half));
}

// A word on a dark ground, at the left or right upper corner of `rect`.
void paintTag(QPainter& painter, const QRectF& rect, const QString& text, bool right) {
  const QRectF size = painter.fontMetrics().boundingRect(text).adjusted(-8, -4, 8, 4);
  const QPointF corner(right ? rect.right() - size.width() - 8 : rect.left() + 8, rect.top() + 8);
  const QRectF ground(corner, size.size());
  painter.setPen(Qt::NoPen);
  painter.setBrush(QColor(0, 0, 0, 160));
  painter.drawRoundedRect(ground, 4, 4);
  painter.setPen(QColor(225, 225, 225));
  painter.drawText(ground, Qt::AlignCenter, text);
}

QString tagOf(const QString& letter, const PicturePtr& picture) {
  const QString name = QFileInfo(QString::fromStdString(picture->path)).fileName();
  return name.isEmpty() ? letter : letter + "   " + name;
}

}  // namespace

void Canvas::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.fillRect(rect(), kAround);
  if (!session_.a() && !session_.b()) {
    painter.setPen(palette().color(QPalette::Disabled, QPalette::WindowText));
    painter.drawText(rect(), Qt::AlignCenter, "Drop an image or a sequence here");
    return;
  }
  for (const Pane& pane : panes()) paintPane(painter, pane);
  painter.setRenderHint(QPainter::Antialiasing);
  paintLegend(painter, rect(), shown_);
  const Comparison shown = comparison();
  if (shown == Comparison::Wipe) paintWipe(painter);
  if (shown == Comparison::Wipe || shown == Comparison::SideBySide) {
    paintTag(painter, rect(), tagOf("A", session_.a()), false);
    paintTag(painter, panes().back().rect, tagOf("B", session_.b()), true);
  } else if (session_.b()) {
    paintTag(painter, rect(),
             shown == Comparison::Difference      ? "A \u2212 B"
             : shown == Comparison::RelativeError ? "Relative error of A against B"
             : shown == Comparison::B             ? tagOf("B", session_.b())
                                                  : tagOf("A", session_.a()),
             false);
  }
}

void Canvas::paintPane(QPainter& painter, const Pane& pane) const {
  const Viewport viewport{viewport_.scale, viewport_.origin + pane.rect.topLeft()};
  painter.save();
  painter.setClipRect(pane.rect);
  painter.fillRect(viewport.toScreen(frame()), Qt::black);
  const bool wipes = comparison() == Comparison::Wipe;
  const auto paint = [&](bool b, const QRectF& part) {
    const bool other = (b ? shown_.b : shown_.a).isNull();  // the answer to what is asked for has not come yet
    const QImage& image = b != other ? shown_.b : shown_.a;
    const SeenPtr& seen = shown_.compared ? shown_.compared : b != other ? shown_.seenB : shown_.seenA;
    if (image.isNull()) return;
    painter.setClipRect(part);
    paintImage(painter, viewport, part, image, shown_.request.box, shown_.pixelSize);
    if (viewport.scale >= kPixelOfValues && seen) paintPixelValues(painter, viewport, part, *seen, image);
  };
  if (wipes) {
    const double line = wipe_ * width();
    paint(false, QRectF(0, 0, line, height()));
    paint(true, QRectF(line, 0, width() - line, height()));
    painter.setClipRect(pane.rect);
  } else {
    paint(pane.showsB, pane.rect);
  }
  const PicturePtr& picture = pane.showsB || !session_.a() ? session_.b() : session_.a();
  paintOutline(painter, viewport, frame(), kFrame, Qt::SolidLine);
  if (picture->dataWindow() != frame()) paintOutline(painter, viewport, picture->dataWindow(), kData, Qt::DashLine);
  paintMarks(painter, viewport);
  painter.restore();
}

void Canvas::paintMarks(QPainter& painter, const Viewport& viewport) const {
  if (const auto box = session_.box()) {
    painter.fillRect(viewport.toScreen(*box), QColor(255, 190, 60, 28));
    paintOutline(painter, viewport, *box, kMark, Qt::SolidLine);
  }
  if (const auto pin = session_.pin()) {
    const Box pixel{pin->x(), pin->y(), pin->x() + 1, pin->y() + 1};
    const QRectF on = viewport.toScreen(pixel);
    const double half = std::max(6.0, on.width() / 2 + 2), arm = half + 7;
    const QPointF centre = on.center();
    for (const auto& [width, colour] : {std::pair(3.0, QColor(0, 0, 0, 170)), std::pair(1.2, kMark)}) {
      painter.setPen(QPen(colour, width));
      painter.drawRect(QRectF(centre - QPointF(half, half), QSizeF(2 * half, 2 * half)));
      for (const QPointF& to : {QPointF(1, 0), QPointF(-1, 0), QPointF(0, 1), QPointF(0, -1)})
        painter.drawLine(centre + to * half, centre + to * arm);
    }
  }
}

void Canvas::paintWipe(QPainter& painter) const {
  const double line = wipe_ * width(), middle = height() / 2.0;
  painter.setPen(QPen(QColor(0, 0, 0, 150), 3));
  painter.drawLine(QPointF(line, 0), QPointF(line, height()));
  painter.setPen(QPen(kMark, 1));
  painter.drawLine(QPointF(line, 0), QPointF(line, height()));
  painter.setBrush(kMark);
  for (const double side : {-1.0, 1.0})
    painter.drawPolygon(QPolygonF({QPointF(line + side * 3, middle - 6), QPointF(line + side * 3, middle + 6),
                                   QPointF(line + side * 10, middle)}));
}

}  // namespace fathom::gui
