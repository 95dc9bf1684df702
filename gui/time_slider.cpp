#include "gui/time_slider.h"

#include <QMouseEvent>
#include <QPainter>
#include <algorithm>
#include <cmath>

namespace fathom::gui {

namespace {

constexpr double kMargin = 12;
constexpr double kTrack = 5;  // height

// The smallest of 1, 2, 5, 10, 20 ... that is at least `least`.
int roundStep(double least) {
  int64_t power = 1;
  for (; power < 1'000'000'000; power *= 10)
    for (const int times : {1, 2, 5})
      if (double(power * times) >= least) return int(power * times);
  return int(power);
}

}  // namespace

TimeSlider::TimeSlider(Player& player, std::function<bool(int)> cached, QWidget* parent)
    : QWidget(parent), player_(player), cached_(std::move(cached)) {
  setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
  setToolTip(tr("Drag to another frame; I and O set the first and the last one that are played"));
  const auto redraw = [this] { update(); };
  connect(&player_, &Player::framesChanged, this, redraw);
  connect(&player_, &Player::frameChanged, this, redraw);
  connect(&player_, &Player::rangeChanged, this, redraw);
}

QSize TimeSlider::sizeHint() const {
  return {400, fontMetrics().height() + 18};
}

QSize TimeSlider::minimumSizeHint() const {
  return {100, sizeHint().height()};
}

double TimeSlider::xOf(double frame) const {
  const double first = player_.frames().front(), last = player_.frames().back();
  const double width = std::max(1.0, this->width() - 2 * kMargin);
  return last > first ? kMargin + (frame - first) / (last - first) * width : kMargin + width / 2;
}

int TimeSlider::frameAt(double x) const {
  const double first = player_.frames().front(), last = player_.frames().back();
  const double width = std::max(1.0, this->width() - 2 * kMargin);
  return int(std::lround(std::clamp(first + (x - kMargin) / width * (last - first), first, last)));
}

void TimeSlider::mousePressEvent(QMouseEvent* event) {
  if (event->button() != Qt::LeftButton) return;
  player_.stop();
  player_.setFrame(frameAt(event->position().x()));
}

void TimeSlider::mouseMoveEvent(QMouseEvent* event) {
  if (event->buttons() & Qt::LeftButton) player_.setFrame(frameAt(event->position().x()));
}

// As many numbers as have room; the current one always, and those it would touch not.
void TimeSlider::drawLabels(QPainter& painter) const {
  const std::vector<int>& frames = player_.frames();
  const QFontMetricsF metrics(painter.font());
  const double bottom = height() - metrics.descent() - 1;
  const double room = metrics.horizontalAdvance(QString::number(frames.back())) + 18;
  const QString current = QString::number(player_.frame());
  const double x = xOf(player_.frame()), half = metrics.horizontalAdvance(current) / 2;
  const int step = roundStep(room * (frames.back() - frames.front()) / std::max(1.0, width() - 2 * kMargin));
  painter.setPen(palette().color(QPalette::PlaceholderText));
  const int64_t first = frames.front() - ((int64_t(frames.front()) % step) + step) % step;
  for (int64_t frame = first; frame <= frames.back(); frame += step) {
    if (frame < frames.front()) continue;
    const QString text = QString::number(frame);
    const double at = xOf(double(frame)), textHalf = metrics.horizontalAdvance(text) / 2;
    if (std::abs(at - x) > half + textHalf + 4) painter.drawText(QPointF(at - textHalf, bottom), text);
  }
  painter.setPen(palette().color(QPalette::Highlight));
  painter.drawText(QPointF(std::clamp(x - half, 0.0, width() - 2 * half), bottom), current);
}

void TimeSlider::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  const std::vector<int>& frames = player_.frames();
  const double top = 6;
  const double half = frames.size() > 1 ? 0.5 : 0;
  const auto span = [&](double from, double to, double y, double high, const QColor& colour) {
    const double left = std::max(xOf(from), kMargin - 4), right = std::min(xOf(to), width() - kMargin + 4);
    painter.fillRect(QRectF(left, y, right - left, high), colour);
  };
  const QColor track = palette().color(QPalette::Mid), played = palette().color(QPalette::Light),
               memory = QColor(80, 150, 90), highlight = palette().color(QPalette::Highlight);
  painter.setOpacity(0.5);
  span(frames.front() - half, frames.back() + half, top, kTrack, track);
  painter.setOpacity(1);
  span(player_.in() - half, player_.out() + half, top, kTrack, played);
  for (size_t i = 0; i < frames.size(); ++i) {
    if (!cached_(frames[i])) continue;
    size_t last = i;
    while (last + 1 < frames.size() && frames[last + 1] == frames[last] + 1 && cached_(frames[last + 1])) ++last;
    span(frames[i] - half, frames[last] + half, top + kTrack, 2, memory);
    i = last;
  }
  // The ends of what is played, where they are not those of the sequence.
  painter.setPen(QPen(palette().color(QPalette::Text), 1.5));
  const auto bracket = [&](double x, double inwards) {
    const QPointF corners[] = {
        {x + inwards, top - 3}, {x, top - 3}, {x, top + kTrack + 5}, {x + inwards, top + kTrack + 5}};
    painter.drawPolyline(corners, 4);
  };
  if (player_.in() > frames.front()) bracket(xOf(player_.in() - half), 4);
  if (player_.out() < frames.back()) bracket(xOf(player_.out() + half), -4);
  const double x = xOf(player_.frame());
  painter.setPen(Qt::NoPen);
  painter.setBrush(highlight);
  painter.drawRoundedRect(QRectF(x - 2, 1, 4, top + kTrack + 6), 2, 2);
  drawLabels(painter);
}

}  // namespace fathom::gui
