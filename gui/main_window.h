// The window: a canvas, panels around it, menus and keys. What happens, happens in the session and in the panels.
#pragma once

#include <QMainWindow>

#include "gui/frames.h"
#include "gui/jobs.h"
#include "gui/session.h"

namespace fathom::gui {

class MainWindow : public QMainWindow {
  Q_OBJECT

 public:
  explicit MainWindow(QWidget* parent = nullptr);

  Session& session() { return session_; }
  Frames& frames() { return frames_; }
  Jobs& jobs() { return jobs_; }

 private:
  Session session_;
  Frames frames_{session_};
  Jobs jobs_;
};

}  // namespace fathom::gui
