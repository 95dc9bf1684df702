#include "gui/info_bar.h"

#include <QPainter>

#include "flat/error.h"
#include "gui/seen.h"

namespace fathom::gui {

namespace {

constexpr int kSides = 8, kAbove = 3;

QString sizeOf(const Picture& picture) {
  const Box& display = picture.displayWindow();
  return QString("%1 \u00d7 %2").arg(display.width()).arg(display.height());
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

void InfoBar::follow() {
  line_.reset();
  update();
}

void InfoBar::setZoom(double zoom) {
  zoom_ = zoom;
  update();
}

QString InfoBar::valuesOf(const PicturePtr& picture, QPoint pixel) const {
  if (!picture->dataWindow().contains(pixel.x(), pixel.y())) return "outside of the data window";
  const ViewState& view = session_.view();
  const Box box{pixel.x(), pixel.y(), pixel.x() + 1, pixel.y() + 1};
  QStringList words;
  try {
    const Seen seen = see(*picture, view.layer, view.clip, box, 1);
    for (const NamedValue& value : namedValues(seen, 0)) words << value.name + " " + value.text;
  } catch (const Error& e) {
    return e.what();
  }
  if (const deep::DeepImage* deep = picture->deep()) {
    const size_t count = deep->count(deep->dataWindow.index(pixel.x(), pixel.y()));
    words << QString("%1 %2").arg(count).arg(count == 1 ? "sample" : "samples");
  }
  return words.join("   ");
}

QString InfoBar::text() const {
  const PicturePtr &a = session_.a(), &b = session_.b();
  if (!a && !b) return {};
  const std::optional<QPoint> pixel = session_.pixel();
  if (!pixel) return sizeOf(a ? *a : *b);
  const QString place = QString("%1, %2%3").arg(pixel->x()).arg(pixel->y()).arg(session_.pin() ? " pinned" : "");
  if (a && b) return QString("%1     A  %2     B  %3").arg(place, valuesOf(a, *pixel), valuesOf(b, *pixel));
  return place + "     " + valuesOf(a ? a : b, *pixel);
}

void InfoBar::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.fillRect(rect(), palette().window());
  if (!line_) line_ = text();
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
