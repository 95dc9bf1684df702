// The row of the picture through the inspected pixel, seen from above: columns across, depth upwards from the camera.
// Computed in the background; the last one stays until the next is there. The wheel looks closer, with Ctrl in depth; a double click shows all.
#pragma once

#include <QImage>
#include <QWidget>
#include <optional>

#include "deep/depth_slice.h"
#include "gui/background.h"
#include "gui/session.h"

namespace fathom::gui {

// A slice as it is drawn, far rows on top; transparent where nothing is. Thin smoke is lifted: opacity is the cube root
// of the alpha that a cell would have were it an eighth of the axis long. Colours (the first three planes; grey without)
// are those of the things themselves, `stops` brighter.
QImage sliceImage(const flat::Image& slice, float stops);

class DepthSlice : public QWidget {
  Q_OBJECT

 public:
  explicit DepthSlice(Session& session, QWidget* parent = nullptr);

  void setLogarithmic(bool logarithmic);
  // Looks at the session's pixel again; its row is computed where it is another one.
  void follow();

  // Where things are drawn.
  QRectF frame() const;
  QPointF placeOf(double x, double depth) const;  // x in pixels of the image
  QSize sizeHint() const override;

 signals:
  void ready();  // a slice has arrived

 protected:
  void paintEvent(QPaintEvent* event) override;
  void resizeEvent(QResizeEvent* event) override;
  void showEvent(QShowEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void leaveEvent(QEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseDoubleClickEvent(QMouseEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;

 private:
  // All that the drawing depends on, beside clip and column.
  struct Request {
    PicturePtr picture;
    std::vector<std::string> colour;
    int y = 0, x0 = 0, x1 = 0, cells = 1;
    bool logarithmic = false;
    std::optional<deep::DepthAxis> axis;  // where the user looks closer
    float stops = 0;
    bool operator==(const Request&) const = default;
  };
  struct Answer {
    Request request;
    deep::DepthAxis whole, axis;  // around all samples of the row, and of the image
    QImage image;
  };
  static Answer answer(Request request);
  std::optional<Request> wanted();
  void forget();
  void setColumns(double x0, double x1);
  void paintAxes(QPainter& painter) const;
  void paintCaption(QPainter& painter) const;
  double across(const QPointF& at) const { return (at.x() - frame().left()) / frame().width(); }
  double upwards(const QPointF& at) const { return (frame().bottom() - at.y()) / frame().height(); }

  Session& session_;
  bool logarithmic_ = false;
  std::optional<int> row_;  // the last that was inspected
  std::optional<Request> requested_;
  std::optional<Answer> shown_;
  Box window_;           // that row, columns and axis were chosen for
  int x0_ = 0, x1_ = 0;  // columns to show
  std::optional<deep::DepthAxis> axis_;
  std::optional<QPointF> mouse_;
  Background job_;
};

}  // namespace fathom::gui
