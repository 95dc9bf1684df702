#include "gui/main_window.h"

#include <QStatusBar>

namespace fathom::gui {

MainWindow::MainWindow(QWidget* parent) : QMainWindow(parent) {
  setWindowTitle("Fathom");
  connect(&session_, &Session::said, this, [this](const QString& line) { statusBar()->showMessage(line); });
}

}  // namespace fathom::gui
