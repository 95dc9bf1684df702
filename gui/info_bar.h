// A line below the picture: the pixel that is pointed at or pinned, its values, how many samples it has, the zoom. The
// values of a pixel with very many samples come a moment later.
#pragma once

#include <QWidget>
#include <optional>

#include "gui/background.h"
#include "gui/session.h"

namespace fathom::gui {

class InfoBar : public QWidget {
  Q_OBJECT

 public:
  explicit InfoBar(Session& session, QWidget* parent = nullptr);

  // What the line says; without the zoom. Composites the pixel, however many samples it has.
  QString text() const { return textOf(asked()); }
  // What is on the screen of it.
  QString line() const { return line_.value_or(QString()); }
  QSize sizeHint() const override;

  void setZoom(double zoom);

 protected:
  void paintEvent(QPaintEvent* event) override;

 private:
  // What the line depends on.
  struct Asked {
    PicturePtr a, b;
    ViewState view;
    std::optional<QPoint> pixel;
    bool pinned;
  };
  Asked asked() const;
  static QString textOf(const Asked& asked);
  void follow();
  void find();

  Session& session_;
  double zoom_ = 1;
  std::optional<QString> line_;  // what was painted last; none where it has to be found anew
  Background background_;
};

}  // namespace fathom::gui
