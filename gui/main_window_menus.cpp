// The menus and keys of the window.
#include <QFileDialog>
#include <QFileInfo>
#include <QMenuBar>
#include <array>

#include "base/error.h"
#include "gui/canvas.h"
#include "gui/compositor.h"
#include "gui/depth_panel.h"
#include "gui/inspector_panel.h"
#include "gui/key_sheet.h"
#include "gui/main_window.h"
#include "gui/recent_files.h"
#include "gui/view_bar.h"

namespace fathom::gui {

namespace {

const QList<QPair<QString, QString>> kGestures = {
    {"Wheel", "Zoom to the cursor"},
    {"Drag", "Move the picture"},
    {"Click", "Pin the pixel for the inspector, or let it go"},
    {"Shift+drag", "A box for the statistics; Shift+click: none"},
    {"Alt+drag", "The near plane at the depth under the cursor"},
    {"Drag the line", "Move the wipe"},
    {"Drop a file", "Open it; with Shift, compare with it"},
};

constexpr const char* kImages = "Images (*.exr *.png *.tif *.tiff *.hdr *.jpg);;All files (*)";

using Keys = QList<QKeySequence>;

template <class Receiver, class Slot>
QAction* addTo(QMenu* menu, const QString& text, const Keys& keys, Receiver* receiver, const Slot& slot) {
  QAction* action = menu->addAction(text);
  action->setShortcuts(keys);
  QObject::connect(action, &QAction::triggered, receiver, slot);
  return action;
}

}  // namespace

void MainWindow::addMenus() {
  addFileMenu();
  addViewMenu();
  addDepthMenu();
  addCompareMenu();
  addFrameMenu();
  addProcessMenu();
  addWindowMenu();
  addHelpMenu();
}

void MainWindow::addFileMenu() {
  QMenu* menu = menuBar()->addMenu("&File");
  addTo(menu, "&Open…", {QKeySequence::Open}, this, [this] { open("Open", &Frames::open); });
  addTo(menu, "Open to &Compare…", {QKeySequence("Ctrl+Shift+O")}, this,
        [this] { open("Open to compare", &Frames::openB); });
  recent_ = new RecentFiles(this);
  menu->addMenu(recent_);
  addTo(menu, "&Reload", {QKeySequence("F5")}, &frames_, &Frames::reload);
  connect(recent_, &RecentFiles::chosen, &frames_, &Frames::open);
  connect(&frames_, &Frames::opened, this,
          [this] { recent_->add(QString::fromStdString(frames_.a()->pattern.text())); });
  menu->addSeparator();
  addTo(menu, "Save Flattened as EXR…", {QKeySequence("Ctrl+S")}, this,
        [this] { save("Save flattened", "exr", [this](const QString& path) { frameJobs_.saveFlattened(path); }); });
  addTo(menu, "Save Deep as EXR…", {QKeySequence("Ctrl+Shift+S")}, this,
        [this] { save("Save deep", "exr", [this](const QString& path) { frameJobs_.saveDeep(path); }); });
  addTo(menu, "Save as It Looks, as PNG…", {QKeySequence("Ctrl+P")}, this, [this] {
    save("Save as it looks", "png", [this](const QString& path) {
      const RenderRequest request{session_.a(), session_.b(), session_.view(), session_.seen()->dataWindow()};
      frameJobs_.savePng(path, [request, display = display_, wipe = canvas_->wipeColumn()] {
        return joined(Compositor(display).make(request, 1), wipe);
      });
    });
  });
  menu->addSeparator();
  addTo(menu, "&Quit", {QKeySequence::Quit}, this, &QWidget::close);
}

void MainWindow::addViewMenu() {
  QMenu* menu = menuBar()->addMenu("&View");
  addTo(menu, "Fit", {QKeySequence("F")}, canvas_, &Canvas::fit);
  addTo(menu, "Pixel for Pixel", {QKeySequence("1")}, canvas_, &Canvas::oneToOne);
  addTo(menu, "Closer", {QKeySequence("+"), QKeySequence("=")}, canvas_, &Canvas::zoomIn);
  addTo(menu, "Farther", {QKeySequence("-")}, canvas_, &Canvas::zoomOut);
  menu->addSeparator();
  addTo(menu, "Next Layer", {QKeySequence("Page Down")}, viewBar_, &ViewBar::nextLayer);
  addTo(menu, "Previous Layer", {QKeySequence("Page Up")}, viewBar_, &ViewBar::previousLayer);
  menu->addActions(viewBar_->isolateActions());
  menu->addSeparator();
  addTo(menu, "Half a Stop Brighter", {QKeySequence("]")}, this, [this] { viewBar_->changeExposure(0.5); });
  addTo(menu, "Half a Stop Darker", {QKeySequence("[")}, this, [this] { viewBar_->changeExposure(-0.5); });
  menu->addSeparator();
  inspector_->unpinAction()->setShortcut(QKeySequence("Escape"));
  menu->addAction(inspector_->unpinAction());
  menu->addActions({inspector_->copyTsvAction(), inspector_->copyJsonAction()});
}

void MainWindow::addDepthMenu() {
  QMenu* menu = menuBar()->addMenu("&Depth");
  const auto changeClip = [this](const auto& change) {
    return [this, change] {
      ViewState view = session_.view();
      change(view.clip);
      session_.setView(view);
    };
  };
  addTo(menu, "Show What Is Removed", {QKeySequence("X")}, this,
        changeClip([](deep::DepthRange& clip) { clip.inverted = !clip.inverted; }));
  addTo(menu, "Show All Depths", {QKeySequence("Backspace")}, this,
        changeClip([](deep::DepthRange& clip) { clip = {}; }));
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

void MainWindow::addProcessMenu() {
  QMenu* menu = menuBar()->addMenu("&Process");
  struct Choice {
    const char *frame, *sequence, *key;
    deep::Quality quality;
  };
  constexpr std::array kChoices = {
      Choice{"Denoise the Frame", "Denoise the Frames to Files…", "N", deep::Quality::Balanced},
      Choice{"Denoise the Frame, Fast", "Denoise the Frames to Files, Fast…", "Shift+N", deep::Quality::Fast},
      Choice{"Denoise the Frame, Best", "Denoise the Frames to Files, Best…", "Ctrl+N", deep::Quality::Best},
  };
  for (const Choice& choice : kChoices)
    addTo(menu, choice.frame, {QKeySequence(choice.key)}, this,
          [this, quality = choice.quality] { frameJobs_.denoiseFrame(quality); });
  menu->addSeparator();
  for (const Choice& choice : kChoices)
    addTo(menu, choice.sequence, {}, this, [this, quality = choice.quality] {
      save("Denoise to files, numbered like A: name.####.exr", "exr",
           [this, quality](const QString& path) { frameJobs_.denoiseSequence(path, quality); });
    });
  menu->addSeparator();
  addTo(menu, "Stop", {QKeySequence("Ctrl+.")}, &jobs_, &Jobs::cancelAll);
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

QString MainWindow::folder() const {
  return frames_.a() ? QFileInfo(QString::fromStdString(frames_.a()->pattern.before)).path() : QString();
}

void MainWindow::open(const QString& title, void (Frames::*take)(const QString&)) {
  const QString path = QFileDialog::getOpenFileName(this, title, folder(), kImages);
  if (!path.isEmpty()) (frames_.*take)(path);
}

void MainWindow::save(const QString& title, const QString& suffix,
                      const std::function<void(const QString& path)>& write) {
  if (!session_.seen()) {
    session_.say("Nothing is open yet");
    return;
  }
  QFileDialog dialog(this, title, folder(), QString("%1 (*.%2)").arg(suffix.toUpper(), suffix));
  dialog.setAcceptMode(QFileDialog::AcceptSave);
  dialog.setDefaultSuffix(suffix);
  if (dialog.exec() == QDialog::Accepted) write(dialog.selectedFiles().value(0));
}

void MainWindow::setComparison(Comparison comparison) {
  ViewState view = session_.view();
  view.comparison = comparison;
  session_.setView(view);
  if (comparison != Comparison::A && !session_.b()) session_.say("There is no B yet: open an image to compare with");
}

}  // namespace fathom::gui
