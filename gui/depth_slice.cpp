#include "gui/depth_slice.h"

#include <QMouseEvent>
#include <QPainter>
#include <QWheelEvent>
#include <algorithm>
#include <cmath>

#include "gui/depth_painting.h"
#include "gui/pixel_samples.h"

namespace fathom::gui {

namespace {

constexpr double kLeft = 44, kTop = 22, kRight = 10, kBottom = 22;  // around the frame
constexpr double kTickRows = 34, kTickColumns = 80;                 // between ticks, at least
constexpr int kFewest = 4;                                          // columns that can be looked at

constexpr double kCell = 3;   // height of a cell, and so of a surface
constexpr double kSlabs = 8;  // whose alphas are shown, along the axis

QRgb shade(double r, double g, double b, double alpha, double cells, float stops) {
  const double light = std::max({r, g, b});
  if (!(alpha > 0) && !(light > 0)) return qRgba(0, 0, 0, 0);
  const double scale = alpha > 0 ? 1 / alpha : 1;
  QColor colour = displayColour(scale * r, scale * g, scale * b, stops);
  const double slab = 1 - std::pow(1 - std::min(alpha > 0 ? alpha : light, 1.0), std::max(cells / kSlabs, 1.0));
  colour.setAlphaF(float(std::cbrt(slab)));
  return qPremultiply(colour.rgba());
}

}  // namespace

QImage sliceImage(const flat::Image& slice, float stops) {
  const Box& window = slice.dataWindow;
  QImage image(window.width(), window.height(), QImage::Format_ARGB32_Premultiplied);
  const Buffer<float>& alpha = slice.get("A").values;
  const bool coloured = slice.planes.size() > 3;
  for (int row = 0; row < window.height(); ++row) {
    auto* line = reinterpret_cast<QRgb*>(image.scanLine(window.height() - 1 - row));
    for (int x = 0; x < window.width(); ++x) {
      const size_t i = size_t(row) * size_t(window.width()) + size_t(x);
      const auto value = [&](size_t plane) { return double(coloured ? slice.planes[plane].values[i] : alpha[i] / 2); };
      line[x] = shade(value(0), value(1), value(2), double(alpha[i]), window.height(), stops);
    }
  }
  return image;
}

DepthSlice::DepthSlice(Session& session, QWidget* parent) : QWidget(parent), session_(session) {
  setMinimumHeight(120);
  setMouseTracking(true);
  connect(&session_, &Session::picturesChanged, this, &DepthSlice::follow);
  connect(&session_, &Session::viewChanged, this, &DepthSlice::follow);
  connect(&job_, &Background::failed, this, [this](const QString& line) {
    shown_.reset();
    update();
    session_.say(line);
  });
}

QSize DepthSlice::sizeHint() const {
  return {420, 300};
}

void DepthSlice::setLogarithmic(bool logarithmic) {
  logarithmic_ = logarithmic;
  axis_.reset();
  follow();
}

std::optional<DepthSlice::Request> DepthSlice::wanted() {
  const PicturePtr& picture = session_.seen();
  const std::optional<QPoint> pixel = session_.pixel();
  if (!picture || !picture->deep() || !isVisible()) return {};
  const Box& window = picture->dataWindow();
  if (window_ != window) {
    window_ = window;
    x0_ = window.x0;
    x1_ = window.x1;
    row_.reset();
    axis_.reset();
  }
  if (pixel && pixel->y() >= window.y0 && pixel->y() < window.y1) row_ = pixel->y();
  if (!row_) return {};
  const int cells = std::clamp(int(frame().height() / kCell), 16, 1024);
  return Request{picture,
                 colourChannels(*picture, session_.view().layer),
                 *row_,
                 x0_,
                 x1_,
                 cells,
                 logarithmic_,
                 axis_,
                 session_.view().display.exposure};
}

DepthSlice::Answer DepthSlice::answer(Request request) {
  const deep::DeepImage& image = *request.picture->deep();
  const deep::DepthExtent extent = deep::depthExtent(image, request.y);
  const deep::DepthAxis whole = deep::axisAround(double(extent.nearest), double(extent.farthest), request.logarithmic);
  const deep::DepthAxis axis = request.axis.value_or(whole);
  const flat::Image slice =
      deep::depthSlice(image, request.y, request.x0, request.x1, axis, request.cells, request.colour);
  QImage picture = sliceImage(slice, request.stops);
  return {std::move(request), whole, axis, std::move(picture)};
}

void DepthSlice::forget() {
  job_.clear();
  requested_.reset();
  shown_.reset();
}

void DepthSlice::follow() {
  update();
  const PicturePtr& picture = session_.seen();
  const bool isOther = requested_ && requested_->picture != picture;
  if (!picture || !picture->deep() || (isOther && !isVisible())) forget();
  const std::optional<Request> request = wanted();
  if (!request || request == requested_) return;
  requested_ = request;
  job_.run([this, request = *request](const Progress&) {
    auto made = std::make_shared<Answer>(answer(request));
    return [this, made] {
      shown_ = std::move(*made);
      update();
      emit ready();
    };
  });
}

QRectF DepthSlice::frame() const {
  return QRectF(rect()).adjusted(kLeft, kTop, -kRight, -kBottom);
}

QPointF DepthSlice::placeOf(double x, double depth) const {
  if (!shown_) return {};
  const Request& of = shown_->request;
  return {frame().left() + (x - of.x0) / (of.x1 - of.x0) * frame().width(),
          frame().bottom() - shown_->axis.place(depth) * frame().height()};
}

void DepthSlice::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.fillRect(rect(), palette().color(QPalette::Base));
  if (!shown_) {
    painter.setPen(between(palette(), 0.5));
    painter.drawText(rect(), Qt::AlignCenter,
                     session_.seen() && !session_.seen()->deep() ? tr("A flat picture has no depth.")
                                                                 : tr("The row under the cursor, seen from above."));
    return;
  }
  paintAxes(painter);
  paintCaption(painter);
  const QRectF area = frame();
  const double enlarged = area.width() * devicePixelRatioF() / shown_->image.width();
  painter.setRenderHint(QPainter::SmoothPixmapTransform, enlarged < 1);
  painter.drawImage(area, shown_->image);
  painter.setClipRect(area.adjusted(-1, -1, 1, 1));
  paintClip(painter, area, Qt::Vertical, shown_->axis, session_.view().clip, palette(),
            [this](double depth) { return placeOf(0, depth).y(); });
  if (const std::optional<QPoint> pixel = session_.pixel()) {
    const double from = placeOf(pixel->x(), 1).x(), to = placeOf(pixel->x() + 1, 1).x();
    QColor mark = palette().color(QPalette::Text);
    mark.setAlphaF(0.75f);
    painter.setPen(QPen(mark, 1));
    if (to - from > 6)
      painter.drawRect(QRectF(from, area.top(), to - from, area.height()));
    else
      painter.drawLine(QPointF((from + to) / 2, area.top()), QPointF((from + to) / 2, area.bottom()));
  }
}

void DepthSlice::paintAxes(QPainter& painter) const {
  const QRectF area = frame();
  const QColor line = between(palette(), 0.12), text = between(palette(), 0.6);
  QFont small = font();
  small.setPointSizeF(small.pointSizeF() * 0.85);
  painter.setFont(small);
  for (const double depth : deep::ticks(shown_->axis, std::max(2, int(area.height() / kTickRows)))) {
    const double y = placeOf(0, depth).y();
    painter.setPen(line);
    painter.drawLine(QPointF(area.left(), y), QPointF(area.right(), y));
    painter.setPen(text);
    painter.drawText(QRectF(0, y - 8, kLeft - 6, 16), Qt::AlignRight | Qt::AlignVCenter, depthText(depth));
  }
  const Request& of = shown_->request;
  painter.setPen(text);
  for (const double x : deep::ticks({double(of.x0), double(of.x1)}, std::max(2, int(area.width() / kTickColumns))))
    painter.drawText(QRectF(placeOf(x, 1).x() - 40, area.bottom() + 3, 80, kBottom - 4),
                     Qt::AlignHCenter | Qt::AlignTop, depthText(x));
}

void DepthSlice::paintCaption(QPainter& painter) const {
  const Request& of = shown_->request;
  QString text = tr("row %1 from above, the camera below").arg(of.y);
  if (mouse_ && frame().contains(*mouse_))
    text = tr("row %1   column %2   depth %3")
               .arg(of.y)
               .arg(std::floor(of.x0 + across(*mouse_) * (of.x1 - of.x0)))
               .arg(depthText(shown_->axis.depth(upwards(*mouse_))));
  painter.setPen(between(palette(), 0.6));
  painter.drawText(QRectF(kLeft, 2, width() - kLeft - kRight, kTop - 4), Qt::AlignLeft | Qt::AlignVCenter, text);
}

void DepthSlice::resizeEvent(QResizeEvent*) {
  follow();
}

void DepthSlice::showEvent(QShowEvent*) {
  follow();
}

void DepthSlice::mouseMoveEvent(QMouseEvent* event) {
  mouse_ = event->position();
  update();
}

void DepthSlice::leaveEvent(QEvent*) {
  mouse_.reset();
  update();
}

// A click looks into that column.
void DepthSlice::mousePressEvent(QMouseEvent* event) {
  if (event->button() != Qt::LeftButton || !shown_) return;
  const Request& of = shown_->request;
  const double place = across(event->position());
  if (place < 0 || place >= 1) return;
  session_.setPin(QPoint(int(std::floor(of.x0 + place * (of.x1 - of.x0))), of.y));
}

void DepthSlice::mouseDoubleClickEvent(QMouseEvent*) {
  axis_.reset();
  setColumns(-HUGE_VAL, HUGE_VAL);
}

void DepthSlice::wheelEvent(QWheelEvent* event) {
  if (!shown_) return;
  event->accept();
  const double factor = std::pow(0.8, double(event->angleDelta().y()) / 120);
  if (event->modifiers() & Qt::ControlModifier) {
    axis_ = deep::zoomed(axis_.value_or(shown_->axis), shown_->whole, upwards(event->position()), factor);
    return follow();
  }
  const double place = across(event->position());
  const double length = std::max((x1_ - x0_) * factor, double(kFewest));
  const double x0 = x0_ + place * (x1_ - x0_) - place * length;
  setColumns(std::round(x0), std::round(x0 + length));
}

void DepthSlice::setColumns(double x0, double x1) {
  x0_ = int(std::clamp(x0, double(window_.x0), double(std::max(window_.x0, window_.x1 - kFewest))));
  x1_ = int(std::clamp(x1, double(std::min(x0_ + kFewest, window_.x1)), double(window_.x1)));
  follow();
}

}  // namespace fathom::gui
