// The window: a canvas, panels around it, menus and keys. What happens, happens in the session and in the panels.
#pragma once

#include <QKeySequence>
#include <QMainWindow>
#include <array>
#include <functional>
#include <utility>

#include "gui/canvas.h"
#include "gui/display.h"
#include "gui/frame_jobs.h"
#include "gui/frames.h"
#include "gui/jobs.h"
#include "gui/placement.h"
#include "gui/session.h"

namespace fathom::gui {

class DepthPanel;
class InspectorPanel;
class RecentFiles;
class ViewBar;

class MainWindow : public QMainWindow {
  Q_OBJECT

 public:
  explicit MainWindow(QWidget* parent = nullptr);
  ~MainWindow() override;

  Session& session() { return session_; }
  Frames& frames() { return frames_; }
  Jobs& jobs() { return jobs_; }
  Canvas& canvas() { return *canvas_; }
  FrameJobs& frameJobs() { return frameJobs_; }
  Placement& placement() { return placement_; }

  // Brings a panel to the front: "inspector", "compare", "place", "depth".
  void showPanel(const QString& name);
  // Places of the panels, the choice of display, of scales and of playing as they were when the last window was closed.
  void restore();

 protected:
  void dragEnterEvent(QDragEnterEvent* event) override;
  // The first file or sequence is A, a second one B; with Shift held, the first is B.
  void dropEvent(QDropEvent* event) override;
  // Asks first while a job runs.
  void closeEvent(QCloseEvent* event) override;

 private:
  void addCanvas();
  void addPanels();
  void addMenus();
  void addFileMenu();
  void addViewMenu();
  void addDepthMenu();
  void addCompareMenu();
  void addFrameMenu();
  void addProcessMenu();
  void addWindowMenu();
  void addHelpMenu();
  std::array<std::pair<QString, QAction*>, 3> keptSwitches() const;
  QString folder() const;  // of A
  void open(const QString& title, void (Frames::*take)(const QString&));
  void save(const QString& title, const QString& suffix, const std::function<void(const QString& path)>& write);
  void setComparison(Comparison comparison);
  void follow();

  Session session_;
  Frames frames_{session_};
  Jobs jobs_;
  FrameJobs frameJobs_{session_, frames_, jobs_};
  Placement placement_{session_, frames_};
  std::shared_ptr<const Display> display_;
  Canvas* canvas_;
  ViewBar* viewBar_;
  DepthPanel* depth_;
  InspectorPanel* inspector_;
  RecentFiles* recent_;
};

}  // namespace fathom::gui
