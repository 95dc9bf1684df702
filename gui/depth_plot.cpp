#include "gui/depth_plot.h"

#include <QMouseEvent>
#include <QPainter>
#include <QPainterPath>
#include <QWheelEvent>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "deep/ops/sample.h"
#include "gui/depth_painting.h"

namespace fathom::gui {

namespace {

constexpr double kLeft = 34, kTop = 22, kRight = 12, kBottom = 22;  // around the frame
constexpr double kBar = 7;                                          // least width of a bar
constexpr double kReach = 4;                                        // how near to a bar the mouse has to be
constexpr double kSpacing = 70;                                     // between ticks, at least

QColor fillOf(const PixelSample& sample) {
  return sample.colour.isValid() ? sample.colour : QColor(Qt::gray);
}

QString captionOf(const PixelSample& sample, int number) {
  QString text = QString("#%1   Z %2").arg(number).arg(depthText(double(sample.range.z)));
  if (!sample.range.isPoint()) text += QString(" to %1").arg(depthText(double(sample.range.zBack)));
  return text + QString("   A %1   seen %2").arg(sample.alpha, 0, 'g', 4).arg(sample.seen, 0, 'g', 4);
}

}  // namespace

DepthPlot::DepthPlot(QWidget* parent) : QWidget(parent) {
  setMouseTracking(true);
  setMinimumHeight(120);
}

QSize DepthPlot::sizeHint() const {
  return {420, 220};
}

void DepthPlot::show(const PixelSamples& samples) {
  const bool same = samples.picture == samples_.picture && samples.pixel == samples_.pixel;
  samples_ = samples;
  bars_ = {};
  if (!same) {
    highlight_ = -1;
    fitAxis();
  }
  update();
}

void DepthPlot::setClip(const deep::DepthRange& clip) {
  clip_ = clip;
  update();
}

void DepthPlot::setLogarithmic(bool logarithmic) {
  logarithmic_ = logarithmic;
  fitAxis();
  update();
}

void DepthPlot::setHighlight(int sample) {
  if (std::exchange(highlight_, sample) != sample) update();
}

void DepthPlot::fitAxis() {
  double nearest = std::numeric_limits<double>::infinity(), farthest = -nearest;
  for (const PixelSample& sample : samples_.samples)
    if (std::isfinite(sample.range.z)) {
      nearest = std::min(nearest, double(sample.range.z));
      farthest = std::max(farthest, double(sample.range.zBack));
    }
  whole_ = axis_ = deep::axisAround(nearest, farthest, logarithmic_);
}

QRectF DepthPlot::frame() const {
  return QRectF(rect()).adjusted(kLeft, kTop, -kRight, -kBottom);
}

// Where bars are seen; those at the sides reach out of the frame by half.
QRectF DepthPlot::barArea() const {
  return frame().adjusted(-kBar, -2, kBar, 2);
}

double DepthPlot::xOf(double depth) const {
  // At least on the side of what is shown: an infinite depth, and a depth that has no logarithm, have a place.
  return frame().left() + std::clamp(axis_.place(depth), -1.0, 2.0) * frame().width();
}

double DepthPlot::yOf(double value) const {
  return frame().bottom() - value * frame().height();
}

// Samples at infinite depths stand on the frame's sides.
QRectF DepthPlot::bar(int sample, double height) const {
  const deep::Range& range = samples_.samples[size_t(sample)].range;
  double left = xOf(double(range.z)), width = xOf(double(range.zBack)) - left;
  if (width < kBar) {
    left += (width - kBar) / 2;
    width = kBar;
  }
  return {left, yOf(height), width, frame().bottom() - yOf(height)};
}

int DepthPlot::sampleAt(const QPointF& at) const {
  int found = -1;
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; samples_.isDeep() && i < int(samples_.samples.size()); ++i) {
    const QRectF area = bar(i, 1);
    const double away = std::max({0.0, area.left() - at.x(), at.x() - area.right()});
    if (away > kReach) continue;
    const double rank = away * 1000 + area.width();  // of bars over one another the narrowest
    if (rank < best) {
      best = rank;
      found = i;
    }
  }
  return found;
}

void DepthPlot::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.fillRect(rect(), palette().color(QPalette::Base));
  if (!samples_.isDeep() || samples_.samples.empty()) {
    painter.setPen(between(palette(), 0.5));
    painter.drawText(
        rect(), Qt::AlignCenter,
        samples_.picture && !samples_.isDeep() ? tr("A flat picture has no depth.") : tr("No samples here."));
    return;
  }
  paintAxes(painter);
  painter.setClipRect(barArea());
  paintBars(painter);
  painter.setRenderHint(QPainter::Antialiasing);
  paintTransmittance(painter);
  paintClip(painter, frame(), Qt::Horizontal, axis_, clip_, palette(), [this](double depth) { return xOf(depth); });
  painter.setClipping(false);
  paintCaption(painter);
}

void DepthPlot::paintAxes(QPainter& painter) const {
  const QRectF area = frame();
  const QColor line = between(palette(), 0.16), text = between(palette(), 0.6);
  QFont small = font();
  small.setPointSizeF(small.pointSizeF() * 0.85);
  painter.setFont(small);
  for (const double value : {0.0, 0.5, 1.0}) {
    painter.setPen(line);
    painter.drawLine(QPointF(area.left(), yOf(value)), QPointF(area.right(), yOf(value)));
    painter.setPen(text);
    painter.drawText(QRectF(0, yOf(value) - 8, kLeft - 6, 16), Qt::AlignRight | Qt::AlignVCenter,
                     QString::number(value));
  }
  for (const double depth : deep::ticks(axis_, std::max(2, int(area.width() / kSpacing)))) {
    painter.setPen(line);
    painter.drawLine(QPointF(xOf(depth), area.top()), QPointF(xOf(depth), area.bottom()));
    painter.setPen(text);
    painter.drawText(QRectF(xOf(depth) - 40, area.bottom() + 3, 80, kBottom - 4), Qt::AlignHCenter | Qt::AlignTop,
                     depthText(depth));
  }
}

void DepthPlot::paintBar(QPainter& painter, int sample, const QPen& outline) const {
  const PixelSample& of = samples_.samples[size_t(sample)];
  QColor faint = fillOf(of);
  faint.setAlphaF(0.25f);
  painter.fillRect(bar(sample, of.alpha), faint);
  painter.fillRect(bar(sample, of.seen), fillOf(of));
  painter.setBrush(Qt::NoBrush);
  painter.setPen(outline);
  painter.drawRect(bar(sample, std::max(of.alpha, 0.01)));
}

// Those in view, tall ones first, so that none hides another; an outline in a tone that is seen on every background.
QPixmap DepthPlot::makeBars(const BarsLook& look) const {
  QPixmap pixmap(look.size * look.ratio);
  pixmap.setDevicePixelRatio(look.ratio);
  pixmap.fill(Qt::transparent);
  std::vector<int> order;
  for (int i = 0; i < int(samples_.samples.size()); ++i)
    if (bar(i, 1).intersects(barArea())) order.push_back(i);
  std::ranges::stable_sort(order, std::ranges::greater(), [&](int i) { return samples_.samples[size_t(i)].alpha; });
  QPainter painter(&pixmap);
  for (const int i : order) paintBar(painter, i, QPen(between(palette(), 0.6), 1));
  return pixmap;
}

// There may be thousands, and the mouse alone has the plot drawn again: they are kept as a picture.
void DepthPlot::paintBars(QPainter& painter) {
  const BarsLook look{axis_, size(), devicePixelRatioF(), palette().cacheKey()};
  if (std::exchange(barsLook_, look) != look || bars_.isNull()) bars_ = makeBars(look);
  painter.drawPixmap(0, 0, bars_);
  if (highlight_ >= 0 && highlight_ < int(samples_.samples.size()))
    paintBar(painter, highlight_, QPen(palette().color(QPalette::Highlight), 2));
}

void DepthPlot::paintTransmittance(QPainter& painter) {
  if (!samples_.problem.isEmpty()) return;
  const QRectF area = frame();
  const double step = 1 / devicePixelRatioF();
  const Curve curve{samples_.picture, samples_.pixel, axis_, int(area.width() / step)};
  if (std::exchange(curve_, curve) != curve) {
    std::vector<float> depths;
    for (int i = 0; i <= curve.steps; ++i) depths.push_back(float(axis_.depth(i * step / area.width())));
    passing_ = deep::passingTo(*samples_.picture->deep(), samples_.pixel.x(), samples_.pixel.y(), depths);
  }
  QPainterPath path;
  for (size_t i = 0; i < passing_.size(); ++i) {
    const QPointF at(area.left() + double(i) * step, yOf(passing_[i]));
    if (i == 0)
      path.moveTo(at);
    else
      path.lineTo(at);
  }
  painter.setBrush(Qt::NoBrush);
  painter.setPen(QPen(palette().color(QPalette::Base), 3.5));
  painter.drawPath(path);
  painter.setPen(QPen(palette().color(QPalette::Text), 1.5));
  painter.drawPath(path);
}

// What the marks mean, or the sample that stands out.
void DepthPlot::paintCaption(QPainter& painter) const {
  const QRectF area(kLeft, 2, width() - kLeft - kRight, kTop - 4);
  painter.setPen(between(palette(), 0.85));
  if (highlight_ >= 0 && highlight_ < int(samples_.samples.size())) {
    painter.drawText(area, Qt::AlignLeft | Qt::AlignVCenter,
                     captionOf(samples_.samples[size_t(highlight_)], highlight_));
    return;
  }
  painter.setPen(between(palette(), 0.6));
  painter.drawText(area, Qt::AlignLeft | Qt::AlignVCenter,
                   tr("outline: alpha    filled: what is seen of it    line: transmittance"));
}

void DepthPlot::mouseMoveEvent(QMouseEvent* event) {
  emit hovered(sampleAt(event->position()));
}

void DepthPlot::mouseDoubleClickEvent(QMouseEvent*) {
  axis_ = whole_;
  update();
}

void DepthPlot::wheelEvent(QWheelEvent* event) {
  axis_ = deep::zoomed(axis_, whole_, (event->position().x() - frame().left()) / frame().width(),
                       std::pow(0.8, double(event->angleDelta().y()) / 120));
  update();
  event->accept();
}

void DepthPlot::leaveEvent(QEvent*) {
  emit hovered(-1);
}

}  // namespace fathom::gui
