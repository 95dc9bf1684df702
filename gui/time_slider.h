// The frames of a sequence as a line: which are in the memory, which are played, and the one on the screen, to drag.
#pragma once

#include <QWidget>
#include <functional>

#include "gui/player.h"

namespace fathom::gui {

class TimeSlider : public QWidget {
  Q_OBJECT

 public:
  // `cached`: whether a frame is in the memory; call update() when that changes.
  TimeSlider(Player& player, std::function<bool(int frame)> cached, QWidget* parent = nullptr);

  QSize sizeHint() const override;
  QSize minimumSizeHint() const override;
  // Between the middle of a frame and a place on the line, in pixels of the widget.
  double xOf(double frame) const;
  int frameAt(double x) const;

 protected:
  void paintEvent(QPaintEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;

 private:
  void drawLabels(QPainter& painter) const;

  Player& player_;
  std::function<bool(int)> cached_;
};

}  // namespace fathom::gui
