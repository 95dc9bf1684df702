#include "gui/main_window.h"

#include <QStatusBar>

#include "gui/jobs_bar.h"
#include "gui/playback_bar.h"

namespace fathom::gui {

MainWindow::MainWindow(QWidget* parent) : QMainWindow(parent) {
  setWindowTitle("Fathom");
  connect(&session_, &Session::said, this, [this](const QString& line) { statusBar()->showMessage(line); });
  addToolBar(Qt::BottomToolBarArea, new PlaybackBar(frames_));
  statusBar()->addPermanentWidget(new JobsBar(jobs_));
  const auto say = [this](const QString&, const QString& line) { session_.say(line); };
  connect(&jobs_, &Jobs::failed, &session_, say);
}

}  // namespace fathom::gui
