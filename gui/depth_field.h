// A depth to be typed: any number, and "inf" or nothing for none.
#pragma once

#include <QLineEdit>
#include <optional>

namespace fathom::gui {

class DepthField : public QLineEdit {
  Q_OBJECT

 public:
  // `none`: the value without a number, which is shown as "-inf", "inf" or "0". `least`: the smallest that is taken.
  DepthField(float none, float least, QWidget* parent = nullptr);

  float value() const { return value_; }
  void setValue(float value);
  // What a text says: a number, inf with a sign or without, the value without a number where it is empty; nothing where
  // it cannot be read.
  std::optional<float> parse(const QString& text) const;

 signals:
  void edited(float value);
  // The wheel, or keys up and down.
  void stepped(int steps);

 protected:
  void keyPressEvent(QKeyEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;

 private:
  void take();

  float none_, least_, value_;
  QString shown_;  // the text that stands for the value
};

}  // namespace fathom::gui
