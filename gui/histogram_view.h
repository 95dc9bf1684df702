// The histogram of depths with the planes over it: to be dragged, zoomed and moved.
#pragma once

#include <QWidget>
#include <vector>

#include "gui/clip_model.h"

namespace fathom::gui {

class HistogramView : public QWidget {
  Q_OBJECT

 public:
  // The model must outlive this.
  explicit HistogramView(ClipModel& model, QWidget* parent = nullptr);

  // Weights of the bins of `axis`, which need not be the one that is shown.
  void setHistogram(const deep::DepthAxis& axis, std::vector<double> bins);
  void setRange(const deep::DepthRange& range);
  void setLogCounts(bool on);
  // Depths of the samples of the pixel that is looked at, each from front to back.
  void setMarks(std::vector<deep::Range> marks);
  // Where a depth is drawn, in coordinates of the widget, and the other way round.
  double xOf(double depth) const;
  double depthAt(double x) const;

  QSize sizeHint() const override { return {640, 150}; }
  QSize minimumSizeHint() const override { return {200, 80}; }

 signals:
  void rangeDragged(const fathom::deep::DepthRange& range);
  void zoomed();

 protected:
  void paintEvent(QPaintEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void mouseReleaseEvent(QMouseEvent* event) override;
  void mouseDoubleClickEvent(QMouseEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  void leaveEvent(QEvent* event) override;

 private:
  QRectF area() const;
  double placeAt(double x) const;
  ClipHandle handleAt(double x) const;
  QPainterPath outline() const;
  QBrush colours() const;
  void paintAxis(QPainter& painter) const;
  void paintMarks(QPainter& painter) const;
  void paintHandles(QPainter& painter) const;
  void paintHover(QPainter& painter) const;

  ClipModel& model_;
  deep::DepthAxis axis_;
  std::vector<double> bins_;
  deep::DepthRange range_, dragStart_;
  std::vector<deep::Range> marks_;
  bool logCounts_ = false;
  ClipHandle held_ = ClipHandle::None, hovered_ = ClipHandle::None;
  bool panning_ = false;
  double grabbed_ = 0;  // place that was pressed
  double hover_ = -1;   // x of the cursor; negative: none
};

}  // namespace fathom::gui
