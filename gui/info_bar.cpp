#include "gui/info_bar.h"

#include <QPainter>

#include "base/error.h"
#include "gui/pixel_samples.h"
#include "gui/seen.h"

namespace fathom::gui {

namespace {

constexpr int kSides = 8, kAbove = 3;

QString sizeOf(const Picture& picture) {
  const Box& display = picture.displayWindow();
  return QString("%1 \u00d7 %2").arg(display.width()).arg(display.height());
}

QString placeOf(QPoint pixel, bool pinned) {
  return QString("%1, %2%3").arg(pixel.x()).arg(pixel.y()).arg(pinned ? " pinned" : "");
}

QString valuesOf(const PicturePtr& picture, const ViewState& view, QPoint pixel) {
  if (!picture->dataWindow().contains(pixel.x(), pixel.y())) return "outside of the data window";
  const Box box{pixel.x(), pixel.y(), pixel.x() + 1, pixel.y() + 1};
  QStringList words;
  try {
    const Seen seen = see(*picture, view.layer, view.clip, box, 1);
    for (const NamedValue& value : namedValues(seen, 0)) words << value.name + " " + value.text;
  } catch (const Error& e) {
    return e.what();
  }
  if (picture->deep()) {
    const size_t count = countAt(picture, pixel);
    words << QString("%1 %2").arg(count).arg(count == 1 ? "sample" : "samples");
  }
  return words.join("   ");
}

}  // namespace

InfoBar::InfoBar(Session& session, QWidget* parent) : QWidget(parent), session_(session) {
  setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
  setMinimumWidth(0);
  for (const auto change : {&Session::picturesChanged, &Session::viewChanged, &Session::pixelChanged})
    connect(&session_, change, this, &InfoBar::follow);
}

QSize InfoBar::sizeHint() const {
  return {400, fontMetrics().height() + 2 * kAbove};
}

InfoBar::Asked InfoBar::asked() const {
  return {session_.a(), session_.b(), session_.view(), session_.pixel(), session_.pin().has_value()};
}

void InfoBar::follow() {
  background_.clear();
  line_.reset();
  update();
}

void InfoBar::find() {
  const Asked of = asked();
  if (!of.pixel || countAt(of.a, of.pixel) + countAt(of.b, of.pixel) <= kManySamples) {
    line_ = textOf(of);
    return;
  }
  line_ = placeOf(*of.pixel, of.pinned);
  background_.run([this, of](const Progress&) {
    return [this, text = textOf(of)] {
      line_ = text;
      update();
    };
  });
}

void InfoBar::setZoom(double zoom) {
  zoom_ = zoom;
  update();
}

QString InfoBar::textOf(const Asked& asked) {
  const auto& [a, b, view, pixel, pinned] = asked;
  if (!a && !b) return {};
  if (!pixel) return sizeOf(a ? *a : *b);
  const QString place = placeOf(*pixel, pinned);
  if (a && b) return QString("%1     A  %2     B  %3").arg(place, valuesOf(a, view, *pixel), valuesOf(b, view, *pixel));
  return place + "     " + valuesOf(a ? a : b, view, *pixel);
}

void InfoBar::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.fillRect(rect(), palette().window());
  if (!line_) find();
  const QRect inside = rect().adjusted(kSides, 0, -kSides, 0);
  const QString zoom =
      zoom_ >= 0.1 ? QString("%1 %").arg(100 * zoom_, 0, 'f', 0) : QString("%1 %").arg(100 * zoom_, 0, 'f', 1);
  painter.setPen(palette().color(QPalette::WindowText));
  painter.drawText(inside, Qt::AlignRight | Qt::AlignVCenter, zoom);
  const QRect left = inside.adjusted(0, 0, -fontMetrics().horizontalAdvance(zoom) - 2 * kSides, 0);
  painter.drawText(left, Qt::AlignLeft | Qt::AlignVCenter,
                   fontMetrics().elidedText(*line_, Qt::ElideRight, left.width()));
}

}  // namespace fathom::gui
