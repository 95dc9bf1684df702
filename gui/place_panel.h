// A volume placed in A: where it stands, by sliders and by numbers.
#pragma once

#include <QDoubleSpinBox>
#include <QLabel>
#include <QSlider>
#include <QWidget>
#include <functional>
#include <vector>

#include "gui/placement.h"

namespace fathom::gui {

class PlacePanel : public QWidget {
  Q_OBJECT

 public:
  PlacePanel(Session& session, Placement& placement, QWidget* parent = nullptr);

  // Asks for a file.
  void open();
  // Back to where the volume was rendered.
  void reset();

 private:
  // One number of the transform: a slider whose middle is its rest, and the number.
  struct Control {
    QSlider* slider;
    QDoubleSpinBox* number;
    double deep::Transform::*member;
    std::function<double(double)> place, value;  // from the number to [-1,1] along the slider, and back
  };
  void addControl(const char* name, const QString& label, const QString& tip, double deep::Transform::*member);
  void change(double deep::Transform::*member, double value);
  void setReach();
  void follow();

  Session& session_;
  Placement& placement_;
  QLabel *name_, *depths_;
  QWidget *controls_, *remove_;
  std::vector<Control> all_;
  double reach_ = 10;  // how far a slider moves in depth
  double width_ = 1000;
};

}  // namespace fathom::gui
