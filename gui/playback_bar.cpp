#include "gui/playback_bar.h"

#include <QEvent>
#include <QPainter>
#include <QSignalBlocker>
#include <array>
#include <string_view>

namespace fathom::gui {

namespace {

// Drawn in the text's colour, so that they suit any theme. '>' and '<' are triangles, '|' is a bar, '[' and ']' are the
// brackets of the line of frames, 'x' a cross.
QIcon drawIcon(std::string_view shapes, const QColor& colour, double ratio) {
  constexpr int kSize = 16;
  QPixmap pixmap(QSize(kSize, kSize) * ratio);
  pixmap.setDevicePixelRatio(ratio);
  pixmap.fill(Qt::transparent);
  QPainter painter(&pixmap);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.setPen(Qt::NoPen);
  painter.setBrush(colour);
  const double width = shapes.size() == 1 ? 11 : 12.0 / double(shapes.size());
  double x = (kSize - width * double(shapes.size())) / 2;
  for (const char shape : shapes) {
    const double right = x + width;
    if (shape == '>') painter.drawPolygon(QPolygonF({{x, 2.5}, {right, 8}, {x, 13.5}}));
    if (shape == '<') painter.drawPolygon(QPolygonF({{right, 2.5}, {x, 8}, {right, 13.5}}));
    if (shape == '|') painter.drawRect(QRectF((x + right) / 2 - 1.5, 2.5, 3, 11));
    if (shape == '[' || shape == ']' || shape == 'x') {
      painter.setPen(QPen(colour, 2));
      painter.setBrush(Qt::NoBrush);
      if (shape == '[') painter.drawPolyline(QPolygonF({{11, 3}, {6, 3}, {6, 13}, {11, 13}}));
      if (shape == ']') painter.drawPolyline(QPolygonF({{5, 3}, {10, 3}, {10, 13}, {5, 13}}));
      if (shape == 'x') painter.drawLines({QLineF(4, 4, 12, 12), QLineF(12, 4, 4, 12)});
    }
    x = right;
  }
  return pixmap;
}

}  // namespace

PlaybackBar::PlaybackBar(Frames& frames, QWidget* parent)
    : QToolBar(tr("Playback"), parent), frames_(frames), player_(frames.player()) {
  setObjectName("playback");
  setIconSize({16, 16});
  setMovable(false);
  first_ = add(tr("First frame"), "|<", &Player::first);
  previous_ = add(tr("Previous frame"), "<", &Player::previous);
  play_ = add(tr("Play"), ">", &Player::toggle);
  next_ = add(tr("Next frame"), ">", &Player::next);
  last_ = add(tr("Last frame"), ">|", &Player::last);
  slider_ = new TimeSlider(player_, [this](int frame) { return frames_.cached(frame); });
  addWidget(slider_);
  in_ = add(tr("Play from here"), "[", &Player::setInHere);
  out_ = add(tr("Play up to here"), "]", &Player::setOutHere);
  clear_ = add(tr("Play all frames"), "x", &Player::clearRange);
  makeControls();
  drawIcons();
  const auto changed = [this] { follow(); };
  connect(&player_, &Player::framesChanged, this, changed);
  connect(&player_, &Player::frameChanged, this, changed);
  connect(&player_, &Player::rangeChanged, this, changed);
  connect(&player_, &Player::settingsChanged, this, changed);
  connect(&player_, &Player::playingChanged, this, [this] { drawIcons(); });
  connect(&frames_.cache(), &FrameCache::contentChanged, slider_, qOverload<>(&QWidget::update));
  connect(&frames_, &Frames::sourcesChanged, this, [this] {
    follow();
    slider_->update();
  });
  follow();
}

QAction* PlaybackBar::add(const QString& text, const char* icon, void (Player::*slot)()) {
  QAction* action = addAction(text, &player_, slot);
  action->setData(QByteArray(icon));
  return action;
}

void PlaybackBar::makeControls() {
  addSeparator();
  frame_ = new QSpinBox;
  frame_->setObjectName("frame");
  frame_->setToolTip(tr("Frame"));
  frame_->setKeyboardTracking(false);
  frame_->setButtonSymbols(QAbstractSpinBox::NoButtons);
  frame_->setAlignment(Qt::AlignRight);
  frame_->setMinimumWidth(fontMetrics().horizontalAdvance("000000"));
  addWidget(frame_);
  fps_ = new QDoubleSpinBox;
  fps_->setObjectName("fps");
  fps_->setToolTip(tr("Frames per second"));
  fps_->setRange(1, 240);
  fps_->setDecimals(3);
  fps_->setSuffix(tr(" fps"));
  fps_->setKeyboardTracking(false);
  fps_->setButtonSymbols(QAbstractSpinBox::NoButtons);
  fps_->setAlignment(Qt::AlignRight);
  addWidget(fps_);
  repeat_ = new QComboBox;
  repeat_->setObjectName("repeat");
  repeat_->setToolTip(tr("At the end"));
  repeat_->addItems({tr("Loop"), tr("Ping-pong"), tr("Once")});  // in the order of Repeat
  addWidget(repeat_);
  for (QWidget* control : std::initializer_list<QWidget*>{frame_, fps_, repeat_})
    control->setFocusPolicy(Qt::ClickFocus);
  for (QAbstractSpinBox* number : std::initializer_list<QAbstractSpinBox*>{frame_, fps_})  // keys belong to the picture
    connect(number, &QAbstractSpinBox::editingFinished, number, &QWidget::clearFocus);
  connect(frame_, &QSpinBox::valueChanged, this, [this](int frame) {
    player_.stop();
    player_.setFrame(frame);
    follow();
  });
  connect(fps_, &QDoubleSpinBox::valueChanged, &player_, &Player::setFps);
  connect(repeat_, &QComboBox::activated, this, [this](int index) { player_.setRepeat(Repeat(index)); });
}

void PlaybackBar::drawIcons() {
  play_->setData(QByteArray(player_.playing() ? "||" : ">"));
  play_->setText(player_.playing() ? tr("Stop") : tr("Play"));
  for (QAction* action : {first_, previous_, play_, next_, last_, in_, out_, clear_})
    action->setIcon(drawIcon(action->data().toByteArray().toStdString(), palette().color(QPalette::ButtonText),
                             devicePixelRatioF()));
}

void PlaybackBar::changeEvent(QEvent* event) {
  QToolBar::changeEvent(event);
  if (event->type() == QEvent::PaletteChange) drawIcons();
}

void PlaybackBar::follow() {
  const std::vector<int>& frames = player_.frames();
  const QSignalBlocker noFrame(frame_), noFps(fps_), noRepeat(repeat_);
  frame_->setRange(frames.front(), frames.back());
  frame_->setValue(player_.frame());
  fps_->setValue(player_.fps());
  repeat_->setCurrentIndex(int(player_.repeat()));
  const bool several = frames.size() > 1, part = player_.in() != frames.front() || player_.out() != frames.back();
  for (QAction* action : {first_, previous_, play_, next_, last_, in_, out_}) action->setEnabled(several);
  clear_->setEnabled(part);
  for (QWidget* widget : std::initializer_list<QWidget*>{frame_, fps_, repeat_, slider_}) widget->setEnabled(several);
}

}  // namespace fathom::gui
