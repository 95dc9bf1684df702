// The window: a canvas, panels around it, menus and keys. What happens, happens in the session and in the panels.
#pragma once

#include <QMainWindow>

#include "gui/session.h"

namespace fathom::gui {

class MainWindow : public QMainWindow {
  Q_OBJECT

 public:
  explicit MainWindow(QWidget* parent = nullptr);

  Session& session() { return session_; }

 private:
  Session session_;
};

}  // namespace fathom::gui
