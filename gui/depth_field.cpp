#include "gui/depth_field.h"

#include <QKeyEvent>
#include <QLocale>
#include <QWheelEvent>
#include <cmath>
#include <limits>

namespace fathom::gui {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

QString textOf(float value) {
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  return QLocale::c().toString(double(value), 'g', 6);
}

}  // namespace

DepthField::DepthField(float none, float least, QWidget* parent)
    : QLineEdit(parent), none_(none), least_(least), value_(none), shown_(textOf(none)) {
  setText(shown_);
  setFocusPolicy(Qt::ClickFocus);  // keys belong to the picture
  setMaximumWidth(fontMetrics().horizontalAdvance("-0.000000") + 20);
  connect(this, &QLineEdit::editingFinished, this, &DepthField::take);
  connect(this, &QLineEdit::returnPressed, this, &QWidget::clearFocus);
}

void DepthField::setValue(float value) {
  value_ = value;
  shown_ = textOf(value);
  if (text() != shown_) setText(shown_);
}

std::optional<float> DepthField::parse(const QString& given) const {
  const QString text = given.trimmed().toLower();
  if (text.isEmpty()) return none_;
  if (text == "inf" || text == "+inf" || text == "∞") return none_ == 0 ? std::nullopt : std::optional(kInfinity);
  if (text == "-inf" || text == "-∞") return least_ > -kInfinity ? std::nullopt : std::optional(-kInfinity);
  bool good = false;
  const float value = QLocale::c().toFloat(text, &good);
  if (!good || !std::isfinite(value) || value < least_) return std::nullopt;
  return value;
}

// What cannot be read leaves the value as it was. A text that was not touched says nothing: it has fewer digits than
// the value.
void DepthField::take() {
  if (text() == shown_) return;
  const std::optional<float> value = parse(text());
  const bool changed = value && *value != value_;
  setValue(value.value_or(value_));
  if (changed) emit edited(value_);
}

void DepthField::keyPressEvent(QKeyEvent* event) {
  if (event->key() == Qt::Key_Up || event->key() == Qt::Key_Down)
    emit stepped(event->key() == Qt::Key_Up ? 1 : -1);
  else if (event->key() == Qt::Key_Escape)
    setValue(value_), clearFocus();
  else
    QLineEdit::keyPressEvent(event);
}

void DepthField::wheelEvent(QWheelEvent* event) {
  if (!hasFocus()) return event->ignore();
  if (event->angleDelta().y() != 0) emit stepped(event->angleDelta().y() > 0 ? 1 : -1);
  event->accept();
}

}  // namespace fathom::gui
