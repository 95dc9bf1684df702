// Playing a sequence: buttons, the line of frames, the number of the current one, the rate, and what comes at the end.
#pragma once

#include <QAction>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QSpinBox>
#include <QToolBar>

#include "gui/frames.h"
#include "gui/time_slider.h"

namespace fathom::gui {

// Its actions have no keys: those are the menus'.
class PlaybackBar : public QToolBar {
  Q_OBJECT

 public:
  explicit PlaybackBar(Frames& frames, QWidget* parent = nullptr);

 protected:
  void changeEvent(QEvent* event) override;

 private:
  QAction* add(const QString& text, const char* icon, void (Player::*slot)());
  void makeControls();
  void drawIcons();
  void follow();

  Frames& frames_;
  Player& player_;
  QAction *first_, *previous_, *play_, *next_, *last_, *in_, *out_, *clear_;
  TimeSlider* slider_;
  QSpinBox* frame_;
  QDoubleSpinBox* fps_;
  QComboBox* repeat_;
};

}  // namespace fathom::gui
