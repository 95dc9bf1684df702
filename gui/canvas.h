// The picture on the screen: moved and zoomed with the mouse, compared, its pixels pointed at.
//
// Wheel: zoom to the cursor. Drag: move (left or middle button). Click: pin the pixel, or let it go. Shift and drag: a
// box; shift and click: none. Alt (or Control, where the desktop takes Alt) and drag: the near plane to the depth under
// the cursor. The line of a wipe is dragged with the left button.
#pragma once

#include <QWidget>
#include <memory>
#include <optional>

#include "gui/renderer.h"
#include "gui/session.h"
#include "gui/viewport.h"

namespace fathom::gui {

class Canvas : public QWidget {
  Q_OBJECT

 public:
  Canvas(Session& session, std::shared_ptr<const Display> display, QWidget* parent = nullptr);

  // Relative to the pane, of which there are two side by side, or else one: the widget.
  const Viewport& viewport() const { return viewport_; }
  // Units of the screen's own pixels per pixel of the picture.
  double zoom() const { return viewport_.scale * devicePixelRatioF(); }
  double wipe() const { return wipe_; }
  // The picture's column that the wipe's line is at.
  double wipeColumn() const { return viewport_.toPicture({wipe_ * width(), 0}).x(); }
  const Rendered& shown() const { return shown_; }
  // False while an answer to what is asked for has not come yet.
  bool isCurrent() const;
  QSize sizeHint() const override { return {960, 600}; }

  void fit();
  void oneToOne() { zoomTo(1); }
  void zoomIn() { zoomTo(2 * zoom()); }
  void zoomOut() { zoomTo(zoom() / 2); }
  // Around the cursor where it is over the picture, or else around the middle.
  void zoomTo(double zoom);
  // Where the wipe's line is: 0 at the left, 1 at the right.
  void setWipe(double place);

 signals:
  void zoomChanged(double zoom);
  // The answer to what is asked for is on the screen.
  void updated();

 protected:
  void paintEvent(QPaintEvent* event) override;
  void resizeEvent(QResizeEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void mouseReleaseEvent(QMouseEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  void leaveEvent(QEvent* event) override;

 private:
  enum class Drag { None, Move, Wipe, Box, Near };
  struct Pane {
    QRect rect;
    bool showsB;
  };

  RenderRequest wanted() const;
  Comparison comparison() const;
  std::vector<Pane> panes() const;
  QPointF inPane(QPointF widget) const;
  QPoint pixelAt(QPointF widget) const { return viewport_.pixelAt(inPane(widget)); }
  bool isOnWipe(QPointF widget) const;
  Box frame() const;
  void setViewport(const Viewport& viewport);
  void follow();
  void request();
  void accept(const Rendered& result);
  void refuse(const QString& reason);
  void point(QPointF widget);
  void cutAt(QPoint pixel);
  void dragBox(QPointF to);
  void click(QPointF at);
  void paintPane(QPainter& painter, const Pane& pane) const;
  void paintMarks(QPainter& painter, const Viewport& viewport) const;
  void paintWipe(QPainter& painter) const;

  Session& session_;
  Renderer renderer_;
  Rendered shown_;
  RenderRequest asked_;
  Viewport viewport_;
  Box framed_;          // that the viewport was last made for
  bool fitted_ = true;  // until the picture is moved or zoomed by hand
  double wipe_ = 0.5;
  Drag drag_ = Drag::None;
  bool moved_ = false;            // far enough to be no click
  std::optional<QPointF> mouse_;  // in the widget, while over it
  QPointF pressed_;               // in the widget
  Viewport before_;               // when the drag began
};

}  // namespace fathom::gui
