#include "gui/histogram_view.h"

#include <QMouseEvent>
#include <QPainter>
#include <QPainterPath>
#include <algorithm>
#include <cmath>
#include <limits>

#include "gui/depth_painting.h"

namespace fathom::gui {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr double kMargin = 16, kTop = 6, kBottom = 22;  // around the bars, in pixels
constexpr double kGripWidth = 9, kGripHeight = 20;
constexpr double kLogRange = 1e4;  // between the highest bar and one that is just seen, with log counts
constexpr double kZoomPerNotch = 0.8;
constexpr double kKept = 0.72, kRemoved = 0.22;  // how far the bars are from the ground to the colour of text

// A grip beside a plane, its round side outwards.
QPainterPath grip(double x, double y, bool toTheLeft) {
  QPainterPath path;
  const double outer = toTheLeft ? -kGripWidth : kGripWidth, bend = outer * 0.4;
  path.moveTo(x, y);
  path.lineTo(x + bend, y);
  path.quadTo(x + outer, y, x + outer, y + 5);
  path.lineTo(x + outer, y + kGripHeight - 5);
  path.quadTo(x + outer, y + kGripHeight, x + bend, y + kGripHeight);
  path.lineTo(x, y + kGripHeight);
  path.closeSubpath();
  return path;
}

}  // namespace

HistogramView::HistogramView(ClipModel& model, QWidget* parent) : QWidget(parent), model_(model) {
  setMouseTracking(true);
  setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Expanding);
  setToolTip(
      "Drag the planes or what is between them. Wheel: zoom; middle button: move; double click: all depths, or "
      "those between the planes.");
}

void HistogramView::setHistogram(const deep::DepthAxis& axis, std::vector<double> bins) {
  axis_ = axis;
  bins_ = std::move(bins);
  update();
}

void HistogramView::setRange(const deep::DepthRange& range) {
  range_ = range;
  update();
}

void HistogramView::setLogCounts(bool on) {
  logCounts_ = on;
  update();
}

void HistogramView::setMarks(std::vector<deep::Range> marks) {
  marks_ = std::move(marks);
  update();
}

QRectF HistogramView::area() const {
  return QRectF(rect()).adjusted(kMargin, kTop, -kMargin, -kBottom);
}

double HistogramView::xOf(double depth) const {
  return area().left() + model_.shown().place(depth) * area().width();
}

double HistogramView::placeAt(double x) const {
  return (x - area().left()) / std::max(1.0, area().width());
}

double HistogramView::depthAt(double x) const {
  return model_.shown().depth(placeAt(x));
}

ClipHandle HistogramView::handleAt(double x) const {
  return model_.handleAt(placeAt(x), (kGripWidth + 3) / std::max(1.0, area().width()), range_);
}

// The bars as one shape: heights are weights per length on the axis, so that zooming does not change their relation.
QPainterPath HistogramView::outline() const {
  const QRectF box = area();
  const double highest = bins_.empty() ? 0 : *std::max_element(bins_.begin(), bins_.end());
  QPainterPath path;
  if (!(highest > 0)) return path;
  const auto y = [&](double weight) {
    const double part = weight / highest;
    return box.bottom() - box.height() * (logCounts_ ? std::log1p(kLogRange * part) / std::log1p(kLogRange) : part);
  };
  const auto edge = [&](size_t i) {
    return std::clamp(xOf(axis_.depth(double(i) / double(bins_.size()))), box.left(), box.right());
  };
  path.moveTo(edge(0), box.bottom());
  for (size_t i = 0; i < bins_.size(); ++i) {
    path.lineTo(edge(i), y(bins_[i]));
    path.lineTo(edge(i + 1), y(bins_[i]));
  }
  path.lineTo(edge(bins_.size()), box.bottom());
  path.closeSubpath();
  return path;
}

// Bright where things are kept, dim where they are removed, and between the two where they fade.
QBrush HistogramView::colours() const {
  const QColor removed = between(palette(), kRemoved);
  const QColor kept = between(palette(), kKept);
  const QColor inside = range_.inverted ? removed : kept, outside = range_.inverted ? kept : removed;
  if (!(range_.near < range_.far)) return outside;
  const QRectF box = area();
  QLinearGradient gradient(box.topLeft(), box.topRight());
  const double ramp = std::min(double(range_.soft), (double(range_.far) - double(range_.near)) / 2);
  const auto put = [&](double depth, const QColor& colour, double aside) {
    const double place = model_.shown().place(depth) + aside;
    if (place > 0 && place < 1) gradient.setColorAt(place, colour);
  };
  const auto at = [&](double depth) {  // the colour at an end of the gradient
    if (depth < double(range_.near) || depth > double(range_.far)) return outside;
    const double nearPart = std::isinf(range_.near) || !(ramp > 0) ? 1 : (depth - double(range_.near)) / ramp;
    const double farPart = std::isinf(range_.far) || !(ramp > 0) ? 1 : (double(range_.far) - depth) / ramp;
    const double fade = std::clamp(std::min(nearPart, farPart), 0.0, 1.0);
    return between(palette(),
                   range_.inverted ? kKept + fade * (kRemoved - kKept) : kRemoved + fade * (kKept - kRemoved));
  };
  constexpr double kStep = 1e-6;
  gradient.setColorAt(0, at(model_.shown().near));
  gradient.setColorAt(1, at(model_.shown().far));
  if (range_.near != -kInfinity) {
    put(double(range_.near), outside, 0);
    put(double(range_.near) + ramp, inside, kStep);
  }
  if (range_.far != kInfinity) {
    put(double(range_.far) - ramp, inside, -kStep);
    put(double(range_.far), outside, 0);
  }
  return gradient;
}

void HistogramView::paintAxis(QPainter& painter) const {
  const QRectF box = area();
  const QColor text = between(palette(), 0.65);
  const QFontMetrics metrics = painter.fontMetrics();
  painter.setPen(between(palette(), 0.3));
  painter.drawLine(box.bottomLeft(), box.bottomRight());
  double free = rect().left();  // labels do not meet
  for (const double tick : deep::ticks(model_.shown(), std::max(2, int(box.width() / 60)))) {
    const double x = xOf(tick);
    const QString label = depthText(tick);
    const double width = metrics.horizontalAdvance(label);
    painter.setPen(text);
    painter.drawLine(QPointF(x, box.bottom()), QPointF(x, box.bottom() + 3));
    if (x - width / 2 < free || x + width / 2 > rect().right()) continue;
    painter.drawText(QPointF(x - width / 2, box.bottom() + 5 + metrics.ascent()), label);
    free = x + width / 2 + 8;
  }
}

// The samples under the cursor, below the axis.
void HistogramView::paintMarks(QPainter& painter) const {
  const QRectF box = area();
  painter.setPen(Qt::NoPen);
  painter.setBrush(palette().color(QPalette::Link));
  for (const deep::Range& mark : marks_) {
    const double begin = xOf(double(mark.z)), end = std::min(xOf(double(mark.zBack)), box.right());
    if (begin <= box.right() && end >= box.left())
      painter.drawRect(
          QRectF(QPointF(std::max(begin, box.left()) - 1, box.bottom()), QPointF(end + 1, box.bottom() + 5)));
  }
}

void HistogramView::paintHandles(QPainter& painter) const {
  const QRectF box = area();
  const double near = box.left() + model_.nearPlace(range_) * box.width();
  const double far = box.left() + model_.farPlace(range_) * box.width();
  const QColor accent = palette().color(QPalette::Highlight);
  const auto colour = [&](ClipHandle handle) {
    const ClipHandle active = held_ != ClipHandle::None ? held_ : hovered_;
    return active == handle || active == ClipHandle::Slab ? accent.lighter(135) : accent;
  };
  if (range_.near < range_.far && !range_.isAll()) {  // the slab's rim
    painter.fillRect(
        QRectF(std::max(near, box.left()), box.top(), std::min(far, box.right()) - std::max(near, box.left()), 2),
        colour(ClipHandle::Slab));
  }
  const auto plane = [&](double x, ClipHandle handle) {
    if (x < box.left() - 0.5 || x > box.right() + 0.5) return;
    painter.setPen(QPen(colour(handle), 1));
    painter.setBrush(colour(handle));
    painter.drawLine(QPointF(x, box.top()), QPointF(x, box.bottom()));
    painter.drawPath(grip(x, box.top(), handle == ClipHandle::Near));
    painter.setPen(QPen(palette().color(QPalette::HighlightedText), 1));
    const double middle = x + (handle == ClipHandle::Near ? -kGripWidth : kGripWidth) / 2;
    for (const double aside : {-1.5, 1.5})
      painter.drawLine(QPointF(middle + aside, box.top() + 6), QPointF(middle + aside, box.top() + kGripHeight - 6));
  };
  plane(near, ClipHandle::Near);
  plane(far, ClipHandle::Far);
}

void HistogramView::paintHover(QPainter& painter) const {
  const QRectF box = area();
  if (hover_ < box.left() || hover_ > box.right()) return;
  const QString text = depthText(depthAt(hover_));
  const QFontMetrics metrics = painter.fontMetrics();
  const double width = metrics.horizontalAdvance(text) + 8;
  const double x = hover_ + 12 + width > box.right() ? hover_ - 12 - width : hover_ + 12;
  painter.setPen(QPen(between(palette(), 0.5), 1, Qt::DotLine));
  painter.drawLine(QPointF(hover_, box.top()), QPointF(hover_, box.bottom()));
  const QRectF label(x, box.top() + 4, width, metrics.height() + 2);
  painter.setPen(Qt::NoPen);
  painter.setBrush(palette().color(QPalette::ToolTipBase));
  painter.drawRoundedRect(label, 3, 3);
  painter.setPen(palette().color(QPalette::ToolTipText));
  painter.drawText(label, Qt::AlignCenter, text);
}

void HistogramView::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.fillRect(rect(), palette().color(QPalette::Window));
  painter.fillRect(area(), palette().color(QPalette::Base));
  painter.fillPath(outline(), colours());
  paintMarks(painter);
  paintAxis(painter);
  if (isEnabled()) paintHandles(painter);
  if (isEnabled() && held_ == ClipHandle::None) paintHover(painter);
}

void HistogramView::mousePressEvent(QMouseEvent* event) {
  const double x = event->position().x();
  grabbed_ = placeAt(x);
  dragStart_ = range_;
  held_ = event->button() == Qt::LeftButton ? handleAt(x) : ClipHandle::None;
  panning_ = held_ == ClipHandle::None && (event->button() == Qt::LeftButton || event->button() == Qt::MiddleButton);
  update();
}

void HistogramView::mouseMoveEvent(QMouseEvent* event) {
  const double x = event->position().x(), place = placeAt(x);
  hover_ = x;
  if (held_ != ClipHandle::None) {
    emit rangeDragged(model_.moved(held_, dragStart_, place - grabbed_));
  } else if (panning_) {
    model_.pan(grabbed_ - place);
    grabbed_ = place;
    emit zoomed();
  } else {
    hovered_ = handleAt(x);
    setCursor(hovered_ == ClipHandle::None   ? Qt::ArrowCursor
              : hovered_ == ClipHandle::Slab ? Qt::OpenHandCursor
                                             : Qt::SizeHorCursor);
  }
  update();
}

void HistogramView::mouseReleaseEvent(QMouseEvent*) {
  held_ = ClipHandle::None;
  panning_ = false;
  update();
}

void HistogramView::mouseDoubleClickEvent(QMouseEvent*) {
  if (model_.isZoomed())
    model_.showAll();
  else
    model_.show(range_);
  emit zoomed();
  update();
}

void HistogramView::wheelEvent(QWheelEvent* event) {
  const double notches = event->angleDelta().y() / 120.0;
  if (notches == 0) return event->ignore();
  model_.zoom(std::clamp(placeAt(event->position().x()), 0.0, 1.0), std::pow(kZoomPerNotch, notches));
  emit zoomed();
  update();
  event->accept();
}

void HistogramView::leaveEvent(QEvent*) {
  hover_ = -1;
  hovered_ = ClipHandle::None;
  update();
}

}  // namespace fathom::gui
