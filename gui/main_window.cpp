#include "gui/main_window.h"

#include <QCloseEvent>
#include <QDockWidget>
#include <QDragEnterEvent>
#include <QDropEvent>
#include <QFileDialog>
#include <QFileInfo>
#include <QMenuBar>
#include <QMimeData>
#include <QSettings>
#include <QStatusBar>
#include <QVBoxLayout>
#include <array>

#include "gui/compare_panel.h"
#include "gui/depth_panel.h"
#include "gui/info_bar.h"
#include "gui/inspector_panel.h"
#include "gui/jobs_bar.h"
#include "gui/key_sheet.h"
#include "gui/place_panel.h"
#include "gui/playback_bar.h"
#include "gui/recent_files.h"
#include "gui/view_bar.h"

namespace fathom::gui {

namespace {

const QList<QPair<QString, QString>> kGestures = {
    {"Wheel", "Zoom to the cursor"},
    {"Drag", "Move the picture"},
    {"Click", "Pin the pixel for the inspector, or let it go"},
    {"Shift+drag", "A box for the statistics"},
    {"Alt+drag", "The near plane at the depth under the cursor"},
    {"Drop a file", "Open it; with Shift, compare with it"},
};

using Keys = QList<QKeySequence>;

template <class Receiver, class Slot>
QAction* addTo(QMenu* menu, const QString& text, const Keys& keys, Receiver* receiver, const Slot& slot) {
  QAction* action = menu->addAction(text);
  action->setShortcuts(keys);
  QObject::connect(action, &QAction::triggered, receiver, slot);
  return action;
}

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
  if (compare)
    frames_.openB(files[0]);
  else
    frames_.open(files[0]);
  if (!compare && files.size() > 1) frames_.openB(files[1]);
  event->acceptProposedAction();
}

void MainWindow::closeEvent(QCloseEvent* event) {
  QSettings settings;
  settings.setValue("geometry", saveGeometry());
  settings.setValue("state", saveState());
  QMainWindow::closeEvent(event);
}

void MainWindow::addCanvas() {
  std::string problem;
  const std::shared_ptr<const Display> display = Display::open(problem);
  canvas_ = new Canvas(session_, display);
  if (!problem.empty()) session_.say(QString::fromStdString(problem));
  viewBar_ = new ViewBar(session_, display);
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

void MainWindow::addMenus() {
  addFileMenu();
  addViewMenu();
  addDepthMenu();
  addCompareMenu();
  addFrameMenu();
  addWindowMenu();
  addHelpMenu();
}

void MainWindow::addFileMenu() {
  QMenu* menu = menuBar()->addMenu("&File");
  addTo(menu, "&Open…", {QKeySequence::Open}, this, [this] { askForFile("Open", &Frames::open); });
  addTo(menu, "Open to &Compare…", {QKeySequence("Ctrl+Shift+O")}, this,
        [this] { askForFile("Open to compare", &Frames::openB); });
  recent_ = new RecentFiles(this);
  menu->addMenu(recent_);
  connect(recent_, &RecentFiles::chosen, &frames_, &Frames::open);
  connect(&frames_, &Frames::sourcesChanged, this, [this] {
    if (frames_.a()) recent_->add(QString::fromStdString(frames_.a()->pattern.text()));
  });
  menu->addSeparator();
  addTo(menu, "&Quit", {QKeySequence::Quit}, this, &QWidget::close);
}

void MainWindow::addViewMenu() {
  QMenu* menu = menuBar()->addMenu("&View");
  addTo(menu, "Next Layer", {QKeySequence("Page Down")}, viewBar_, &ViewBar::nextLayer);
  addTo(menu, "Previous Layer", {QKeySequence("Page Up")}, viewBar_, &ViewBar::previousLayer);
  menu->addActions(viewBar_->isolateActions());
  menu->addSeparator();
  addTo(menu, "Half a Stop Brighter", {QKeySequence("]")}, this, [this] { viewBar_->changeExposure(0.5); });
  addTo(menu, "Half a Stop Darker", {QKeySequence("[")}, this, [this] { viewBar_->changeExposure(-0.5); });
  menu->addSeparator();
  inspector_->unpinAction()->setShortcut(QKeySequence("Escape"));
  menu->addAction(inspector_->unpinAction());
}

void MainWindow::addDepthMenu() {
  QMenu* menu = menuBar()->addMenu("&Depth");
  addTo(menu, "Show What Is Removed", {QKeySequence("X")}, this, [this] {
    ViewState view = session_.view();
    view.clip.inverted = !view.clip.inverted;
    session_.setView(view);
  });
  addTo(menu, "Show All Depths", {QKeySequence("Backspace")}, this, [this] {
    ViewState view = session_.view();
    view.clip = {};
    session_.setView(view);
  });
  depth_->animateAction()->setShortcut(QKeySequence("Z"));
  menu->addAction(depth_->animateAction());
  menu->addAction(inspector_->logarithmicAction());
}

void MainWindow::addCompareMenu() {
  QMenu* menu = menuBar()->addMenu("&Compare");
  addTo(menu, "Toggle A and B", {QKeySequence("Space")}, this,
        [this] { setComparison(session_.view().comparison == Comparison::B ? Comparison::A : Comparison::B); });
  struct Mode {
    const char *text, *key;
    Comparison comparison;
  };
  for (const Mode& mode : std::array{
           Mode{"Wipe", "W", Comparison::Wipe}, Mode{"Side by Side", "S", Comparison::SideBySide},
           Mode{"Difference", "D", Comparison::Difference}, Mode{"Relative Error", "E", Comparison::RelativeError}})
    addTo(menu, mode.text, {QKeySequence(mode.key)}, this, [this, comparison = mode.comparison] {
      setComparison(session_.view().comparison == comparison ? Comparison::A : comparison);
    });
  menu->addSeparator();
  addTo(menu, "Swap A and B", {QKeySequence("Ctrl+Space")}, &frames_, &Frames::swap);
  addTo(menu, "Close B", {}, &frames_, &Frames::closeB);
}

void MainWindow::addFrameMenu() {
  QMenu* menu = menuBar()->addMenu("F&rame");
  Player* player = &frames_.player();
  addTo(menu, "Play or Stop", {QKeySequence("P")}, player, &Player::toggle);
  addTo(menu, "Next", {QKeySequence("Right")}, player, &Player::next);
  addTo(menu, "Previous", {QKeySequence("Left")}, player, &Player::previous);
  addTo(menu, "First", {QKeySequence("Home")}, player, &Player::first);
  addTo(menu, "Last", {QKeySequence("End")}, player, &Player::last);
  menu->addSeparator();
  addTo(menu, "Begin Here", {QKeySequence("I")}, player, &Player::setInHere);
  addTo(menu, "End Here", {QKeySequence("O")}, player, &Player::setOutHere);
  addTo(menu, "All Frames", {QKeySequence("Shift+I")}, player, &Player::clearRange);
}

void MainWindow::addWindowMenu() {
  QMenu* panels = createPopupMenu();
  panels->setTitle("&Window");
  menuBar()->addMenu(panels);
}

void MainWindow::addHelpMenu() {
  QMenu* menu = menuBar()->addMenu("&Help");
  addTo(menu, "&Keys", {QKeySequence("?"), QKeySequence("F1")}, this, [this] {
    KeySheet sheet(*menuBar(), kGestures, this);
    sheet.exec();
  });
}

void MainWindow::askForFile(const QString& title, void (Frames::*open)(const QString&)) {
  const QString folder =
      frames_.a() ? QFileInfo(QString::fromStdString(frames_.a()->pattern.before)).path() : QString();
  const QString path =
      QFileDialog::getOpenFileName(this, title, folder, "Images (*.exr *.png *.tif *.tiff *.hdr *.jpg);;All files (*)");
  if (!path.isEmpty()) (frames_.*open)(path);
}

void MainWindow::setComparison(Comparison comparison) {
  ViewState view = session_.view();
  view.comparison = comparison;
  session_.setView(view);
  if (comparison != Comparison::A && !session_.b()) session_.say("There is no B yet: open an image to compare with");
}

void MainWindow::follow() {
  const PicturePtr& a = session_.a();
  setWindowTitle(
      a ? QString("%1 (%2) - Fathom").arg(QFileInfo(QString::fromStdString(a->path)).fileName(), describe(*a))
        : QString("Fathom"));
}

}  // namespace fathom::gui
