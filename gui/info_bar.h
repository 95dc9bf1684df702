// A line below the picture: the pixel that is pointed at or pinned, its values, how many samples it has, the zoom.
#pragma once

#include <QWidget>
#include <optional>

#include "gui/session.h"

namespace fathom::gui {

class InfoBar : public QWidget {
  Q_OBJECT

 public:
  explicit InfoBar(Session& session, QWidget* parent = nullptr);

  // What the line says; without the zoom.
  QString text() const;
  QSize sizeHint() const override;

 public slots:
  void setZoom(double zoom);

 protected:
  void paintEvent(QPaintEvent* event) override;

 private:
  void follow();
  QString valuesOf(const PicturePtr& picture, QPoint pixel) const;

  Session& session_;
  double zoom_ = 1;
  std::optional<QString> line_;  // what was painted last; none where it has to be found anew
};

}  // namespace fathom::gui
