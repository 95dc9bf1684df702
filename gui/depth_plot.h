// One pixel over depth: its samples as bars in their colours, outlined up to alpha and filled up to what is seen of them;
// the transmittance falling from front to back; what is clipped away dimmed. The wheel looks closer, a double click
// shows all.
#pragma once

#include <QPixmap>
#include <QWidget>
#include <vector>

#include "deep/clip_view.h"
#include "deep/depth_axis.h"
#include "gui/pixel_samples.h"

namespace fathom::gui {

class DepthPlot : public QWidget {
  Q_OBJECT

 public:
  explicit DepthPlot(QWidget* parent = nullptr);

  void show(const PixelSamples& samples);
  void setClip(const deep::DepthRange& clip);
  void setLogarithmic(bool logarithmic);
  void setHighlight(int sample);  // -1: none

  const deep::DepthAxis& axis() const { return axis_; }
  // Where things are drawn: the frame around the bars, and a bar up to `height` of 1.
  QRectF frame() const;
  QRectF bar(int sample, double height) const;
  QSize sizeHint() const override;

 signals:
  void hovered(int sample);  // -1: none

 protected:
  void paintEvent(QPaintEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void mouseDoubleClickEvent(QMouseEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  void leaveEvent(QEvent* event) override;

 private:
  // All that the line of the transmittance depends on.
  struct Curve {
    PicturePtr picture;
    QPoint pixel;
    deep::DepthAxis axis;
    int steps = 0;
    bool operator==(const Curve&) const = default;
  };
  // All that the bars depend on beside the samples.
  struct BarsLook {
    deep::DepthAxis axis;
    QSize size;
    double ratio = 0;  // pixels of the device per unit
    qint64 palette = 0;
    bool operator==(const BarsLook&) const = default;
  };
  void fitAxis();
  QRectF barArea() const;
  double xOf(double depth) const;
  double yOf(double value) const;
  int sampleAt(const QPointF& at) const;
  void paintAxes(QPainter& painter) const;
  void paintBars(QPainter& painter);
  void paintBar(QPainter& painter, int sample, const QPen& outline) const;
  QPixmap makeBars(const BarsLook& look) const;
  void paintTransmittance(QPainter& painter);
  void paintCaption(QPainter& painter) const;

  PixelSamples samples_;
  BarsLook barsLook_;            // of `bars_`
  QPixmap bars_;                 // none stands out; null: to be drawn anew
  Curve curve_;                  // that was drawn last
  std::vector<double> passing_;  // its values
  deep::DepthRange clip_;
  deep::DepthAxis whole_, axis_;  // around all samples, and what is shown of it
  bool logarithmic_ = false;
  int highlight_ = -1;
};

}  // namespace fathom::gui
