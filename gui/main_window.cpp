#include "gui/main_window.h"

#include <QCloseEvent>
#include <QDockWidget>
#include <QDragEnterEvent>
#include <QDropEvent>
#include <QFileInfo>
#include <QMessageBox>
#include <QMimeData>
#include <QSettings>
#include <QStatusBar>
#include <QToolBar>
#include <QVBoxLayout>
#include <algorithm>

#include "gui/compare_panel.h"
#include "gui/depth_panel.h"
#include "gui/info_bar.h"
#include "gui/inspector_panel.h"
#include "gui/jobs_bar.h"
#include "gui/place_panel.h"
#include "gui/playback_bar.h"
#include "gui/recent_files.h"
#include "gui/view_bar.h"

namespace fathom::gui {

namespace {

// What is kept between runs.
constexpr std::array<std::pair<const char*, std::string DisplayParams::*>, 3> kKeptChoices = {{
    {"display", &DisplayParams::display},
    {"view", &DisplayParams::view},
    {"look", &DisplayParams::look},
}};

// What the title says of a picture: what it is, and how much of it.
QString describe(const Picture& picture) {
  const Box& window = picture.dataWindow();
  const QString size = QString("%1 x %2").arg(window.width()).arg(window.height());
  if (!picture.deep()) return QString("flat, %1").arg(size);
  return QString("deep, %1, %L2 samples").arg(size).arg(qulonglong(picture.deep()->samples()));
}

}  // namespace

MainWindow::MainWindow(QWidget* parent) : QMainWindow(parent) {
  setAcceptDrops(true);
  resize(1440, 900);
  connect(&session_, &Session::said, this, [this](const QString& line) { statusBar()->showMessage(line); });
  addCanvas();
  addPanels();
  addMenus();
  connect(&session_, &Session::picturesChanged, this, &MainWindow::follow);
  follow();
}

// The widgets refer to the models, which as members go before what Qt deletes by itself.
MainWindow::~MainWindow() {
  qDeleteAll(findChildren<QDockWidget*>());
  qDeleteAll(findChildren<QToolBar*>(QString(), Qt::FindDirectChildrenOnly));
  delete statusBar();
  delete centralWidget();
}

void MainWindow::showPanel(const QString& name) {
  if (auto* dock = findChild<QDockWidget*>(name)) {
    dock->show();
    dock->raise();
  }
}

void MainWindow::restore() {
  const QSettings settings;
  restoreGeometry(settings.value("geometry").toByteArray());
  restoreState(settings.value("state").toByteArray());
  ViewState view = session_.view();
  for (const auto& [key, member] : kKeptChoices) view.display.*member = settings.value(key).toString().toStdString();
  session_.setView(view);
  for (const auto& [key, action] : keptSwitches())
    action->setChecked(settings.value(key, action->isChecked()).toBool());
  Player& player = frames_.player();
  player.setFps(settings.value("fps", player.fps()).toDouble());
  player.setRepeat(Repeat(std::clamp(settings.value("repeat").toInt(), int(Repeat::Loop), int(Repeat::Once))));
}

std::array<std::pair<QString, QAction*>, 3> MainWindow::keptSwitches() const {
  return {{{"logDepth", depth_->logDepthAction()},
           {"logCounts", depth_->logCountsAction()},
           {"logSamples", inspector_->logarithmicAction()}}};
}

void MainWindow::dragEnterEvent(QDragEnterEvent* event) {
  if (event->mimeData()->hasUrls()) event->acceptProposedAction();
}

void MainWindow::dropEvent(QDropEvent* event) {
  QStringList files;
  for (const QUrl& url : event->mimeData()->urls())
    if (url.isLocalFile()) files << url.toLocalFile();
  if (files.isEmpty()) return;
  const bool compare = event->modifiers() & Qt::ShiftModifier;
  files = distinctSources(files);
  if (compare)
    frames_.openB(files[0]);
  else
    frames_.open(files[0]);
  if (!compare && files.size() > 1) frames_.openB(files[1]);
  event->acceptProposedAction();
}

void MainWindow::closeEvent(QCloseEvent* event) {
  if (jobs_.busy() &&
      QMessageBox::question(this, "Close", QString("%1 has not ended. Stop it and close?").arg(jobs_.name())) !=
          QMessageBox::Yes)
    return event->ignore();
  QSettings settings;
  settings.setValue("geometry", saveGeometry());
  settings.setValue("state", saveState());
  for (const auto& [key, member] : kKeptChoices)
    settings.setValue(key, QString::fromStdString(session_.view().display.*member));
  for (const auto& [key, action] : keptSwitches()) settings.setValue(key, action->isChecked());
  settings.setValue("fps", frames_.player().fps());
  settings.setValue("repeat", int(frames_.player().repeat()));
  QMainWindow::closeEvent(event);
}

void MainWindow::addCanvas() {
  std::string problem;
  display_ = Display::open(problem);
  canvas_ = new Canvas(session_, display_);
  if (!problem.empty()) session_.say(QString::fromStdString(problem));
  viewBar_ = new ViewBar(session_, display_);
  addToolBar(Qt::TopToolBarArea, viewBar_);
  auto* info = new InfoBar(session_);
  connect(canvas_, &Canvas::zoomChanged, info, &InfoBar::setZoom);
  auto* centre = new QWidget;
  auto* column = new QVBoxLayout(centre);
  column->setContentsMargins(0, 0, 0, 0);
  column->setSpacing(0);
  column->addWidget(canvas_, 1);
  column->addWidget(info);
  setCentralWidget(centre);
}

void MainWindow::addPanels() {
  addToolBar(Qt::BottomToolBarArea, new PlaybackBar(frames_));
  statusBar()->addPermanentWidget(new JobsBar(jobs_));
  auto* inspector = new QDockWidget("Inspector", this);
  inspector->setObjectName("inspector");
  inspector->setWidget(inspector_ = new InspectorPanel(session_, inspector));
  addDockWidget(Qt::RightDockWidgetArea, inspector);
  const auto addBeside = [&](const QString& title, const char* name, QWidget* panel) {
    auto* dock = new QDockWidget(title, this);
    dock->setObjectName(name);
    dock->setWidget(panel);
    addDockWidget(Qt::RightDockWidgetArea, dock);
    tabifyDockWidget(inspector, dock);
  };
  addBeside("Compare", "compare", new ComparePanel(session_, frames_));
  addBeside("Place", "place", new PlacePanel(session_, placement_));
  inspector->raise();
  auto* depth = new QDockWidget("Depth", this);
  depth->setObjectName("depth");
  depth->setWidget(depth_ = new DepthPanel(session_));
  addDockWidget(Qt::BottomDockWidgetArea, depth);
}

void MainWindow::follow() {
  const PicturePtr& a = session_.a();
  setWindowTitle(
      a ? QString("%1 (%2) - Fathom").arg(QFileInfo(QString::fromStdString(a->path)).fileName(), describe(*a))
        : QString("Fathom"));
}

}  // namespace fathom::gui
