// The window as a whole: its keys, what its title and its status bar say.
#include "gui/main_window.h"

#include <gtest/gtest.h>

#include <QAbstractSpinBox>
#include <QApplication>
#include <QDockWidget>
#include <QDoubleSpinBox>
#include <QDropEvent>
#include <QFileInfo>
#include <QLabel>
#include <QLineEdit>
#include <QMenuBar>
#include <QMessageBox>
#include <QMimeData>
#include <QPointer>
#include <QPushButton>
#include <QStatusBar>
#include <QToolBar>
#include <QtTest>
#include <algorithm>
#include <atomic>
#include <map>

#include "gui/canvas.h"
#include "gui/depth_panel.h"
#include "gui/key_sheet.h"
#include "gui/recent_files.h"

namespace fathom::gui {
namespace {

class MainWindowTest : public ::testing::Test {
 protected:
  MainWindowTest() {
    window_.show();
    window_.frames().open(FATHOM_DEMO "/sequence.####.deep.exr");
    EXPECT_TRUE(QTest::qWaitFor([&] { return window_.session().a() != nullptr; }, 20000));
  }
  void press(Qt::Key key, Qt::KeyboardModifiers modifiers = Qt::NoModifier) {
    QTest::keyClick(&window_, key, modifiers);
  }
  const ViewState& view() { return window_.session().view(); }
  MainWindow window_;
};

TEST_F(MainWindowTest, TheTitleSaysWhatTheFileIs) {
  EXPECT_TRUE(window_.windowTitle().startsWith("sequence.0001.deep.exr (deep, 192 x 108, "))
      << window_.windowTitle().toStdString();
}

TEST_F(MainWindowTest, AnUnreadableFileIsALineAndThePictureStays) {
  const PicturePtr before = window_.session().a();
  for (int time = 0; time < 2; ++time) {
    window_.statusBar()->clearMessage();
    window_.frames().open("/nowhere/nothing.exr");
    EXPECT_TRUE(QTest::qWaitFor([&] { return window_.statusBar()->currentMessage().contains("nothing.exr"); }, 20000));
    EXPECT_EQ(window_.session().a(), before);
  }
}

TEST_F(MainWindowTest, KeysOfTheView) {
  press(Qt::Key_G);
  EXPECT_EQ(view().isolate, Isolate::Green);
  press(Qt::Key_C);
  EXPECT_EQ(view().isolate, Isolate::All);
  press(Qt::Key_BracketRight);
  EXPECT_EQ(view().display.exposure, 0.5f);
  auto* canvas = window_.findChild<Canvas*>();
  press(Qt::Key_F);
  const double fitted = canvas->zoom();
  press(Qt::Key_Plus);
  EXPECT_DOUBLE_EQ(canvas->zoom(), 2 * fitted);
  press(Qt::Key_F);
  EXPECT_DOUBLE_EQ(canvas->zoom(), fitted);
}

TEST_F(MainWindowTest, KeysBelongToThePictureAgainOnceANumberIsTyped) {
  window_.activateWindow();
  ASSERT_TRUE(QTest::qWaitForWindowActive(&window_));
  const QList<QAbstractSpinBox*> numbers = window_.findChildren<QAbstractSpinBox*>();
  ASSERT_GE(numbers.size(), 8);
  for (QAbstractSpinBox* number : numbers) {
    if (!number->isVisible() || !number->isEnabled()) continue;
    number->setFocus();
    ASSERT_TRUE(number->hasFocus()) << number->toolTip().toStdString();
    QTest::keyClick(number, Qt::Key_Return);
    EXPECT_FALSE(number->hasFocus()) << number->toolTip().toStdString();
  }
  auto* exposure = window_.findChildren<QDoubleSpinBox*>()[0];
  exposure->setFocus();
  exposure->selectAll();
  QTest::keyClicks(exposure, "1.5");
  QTest::keyClick(exposure, Qt::Key_Return);
  EXPECT_EQ(view().display.exposure, 1.5f);
  QWidget* focus = QApplication::focusWidget();
  QTest::keyClick(focus ? focus : &window_, Qt::Key_R);
  EXPECT_EQ(view().isolate, Isolate::Red);
}

TEST_F(MainWindowTest, KeysOfTheDepth) {
  press(Qt::Key_X);
  EXPECT_TRUE(view().clip.inverted);
  press(Qt::Key_Backspace);
  EXPECT_TRUE(view().clip.isAll());
}

TEST_F(MainWindowTest, KeysOfTheFrames) {
  Player& player = window_.frames().player();
  press(Qt::Key_Right);
  EXPECT_EQ(player.frame(), 2);
  press(Qt::Key_I);
  EXPECT_EQ(player.in(), 2);
  press(Qt::Key_End);
  press(Qt::Key_O);
  EXPECT_EQ(player.out(), 3);
  press(Qt::Key_Left);
  EXPECT_EQ(player.frame(), 2);
}

TEST_F(MainWindowTest, SpaceTogglesAAndB) {
  window_.frames().openB(FATHOM_DEMO "/sequence.####.ref.exr");
  ASSERT_TRUE(QTest::qWaitFor([&] { return window_.session().b() != nullptr; }, 20000));
  press(Qt::Key_Space);
  EXPECT_EQ(view().comparison, Comparison::B);
  press(Qt::Key_Space);
  EXPECT_EQ(view().comparison, Comparison::A);
  press(Qt::Key_W);
  EXPECT_EQ(view().comparison, Comparison::Wipe);
}

TEST_F(MainWindowTest, ANewWindowLooksLikeTheLastOne) {
  ViewState changed = view();
  changed.display.display = "Rec.1886 / Rec.709";
  window_.session().setView(changed);
  window_.findChild<QDockWidget*>("depth")->hide();
  const auto logDepth = [](MainWindow& window) { return window.findChild<DepthPanel*>()->logDepthAction(); };
  logDepth(window_)->setChecked(true);
  window_.frames().player().setFps(12);
  window_.frames().player().setRepeat(Repeat::PingPong);
  window_.close();
  MainWindow next;
  next.restore();
  EXPECT_TRUE(logDepth(next)->isChecked());
  EXPECT_EQ(next.frames().player().fps(), 12);
  EXPECT_EQ(next.frames().player().repeat(), Repeat::PingPong);
  EXPECT_EQ(next.session().view().display.display, changed.display.display);
  EXPECT_TRUE(next.findChild<QDockWidget*>("depth")->isHidden());
  EXPECT_FALSE(next.findChild<QDockWidget*>("inspector")->isHidden());
}

TEST_F(MainWindowTest, FilesOpenedLastAreInTheMenu) {
  const QString pattern = QFileInfo(FATHOM_DEMO "/sequence.####.deep.exr").absoluteFilePath();
  window_.frames().open("/nowhere/nothing.exr");
  EXPECT_TRUE(QTest::qWaitFor([&] { return window_.statusBar()->currentMessage().contains("nothing.exr"); }, 20000));
  EXPECT_EQ(window_.findChild<RecentFiles*>()->files().value(0), pattern);
}

// With a number half typed, a picture on its way to the screen, and another one from the disk.
TEST(MainWindow, ItsWidgetsGoBeforeWhatTheyReferTo) {
  auto* window = new MainWindow;
  window->show();
  window->activateWindow();
  window->frames().open(FATHOM_DEMO "/sequence.####.deep.exr");
  ASSERT_TRUE(QTest::qWaitFor([&] { return window->session().a() != nullptr; }, 20000));
  auto* field = window->findChild<QDockWidget*>("depth")->findChild<QLineEdit*>();
  field->setFocus();
  QTest::keyClicks(field, "2.5");
  window->frames().openB(FATHOM_DEMO "/sequence.####.ref.exr");
  QList<QPointer<QObject>> users = {&window->canvas()};
  for (auto* dock : window->findChildren<QDockWidget*>()) users << dock->widget();
  for (auto* bar : window->findChildren<QToolBar*>()) users << bar;
  const auto left = [&] { return std::ranges::count_if(users, [](const auto& user) { return !user.isNull(); }); };
  ASSERT_GE(left(), 6);
  QObject::connect(&window->placement(), &QObject::destroyed, [&] { EXPECT_EQ(left(), 0); });  // the first to go
  delete window;
  EXPECT_EQ(left(), 0);
}

TEST_F(MainWindowTest, DroppedFramesOfASequenceAreA) {
  QMimeData files;
  files.setUrls({QUrl::fromLocalFile(FATHOM_DEMO "/sequence.0002.deep.exr"),
                 QUrl::fromLocalFile(FATHOM_DEMO "/sequence.0001.deep.exr")});
  QDropEvent drop(QPointF(5, 5), Qt::CopyAction, &files, Qt::LeftButton, Qt::NoModifier);
  static_cast<QObject&>(window_).event(&drop);
  EXPECT_EQ(window_.frames().player().frame(), 2);
  EXPECT_FALSE(window_.frames().b());
}

TEST_F(MainWindowTest, ClosingStopsAJobOnlyAfterAQuestion) {
  std::atomic<bool> held = true;
  window_.jobs().add({"work", "Work", [&](const Progress& progress) -> std::function<void()> {
                        while (held) progress.at(0.5);
                        return {};
                      }});
  const auto closeAnswering = [this](QMessageBox::StandardButton answer) {
    QTimer::singleShot(0, [answer] {
      auto* box = qobject_cast<QMessageBox*>(QApplication::activeModalWidget());
      ASSERT_TRUE(box);
      box->button(answer)->click();
    });
    return window_.close();
  };
  EXPECT_FALSE(closeAnswering(QMessageBox::No));
  EXPECT_TRUE(window_.isVisible());
  EXPECT_TRUE(window_.jobs().busy());
  EXPECT_TRUE(closeAnswering(QMessageBox::Yes));
  held = false;
  ASSERT_TRUE(QTest::qWaitFor([&] { return !window_.jobs().busy(); }, 20000));
}

// One key, one meaning; and the sheet has them all.
TEST_F(MainWindowTest, NoKeyIsGivenTwice) {
  std::map<QString, QString> taken;
  for (const QAction* action : window_.findChildren<QAction*>())
    for (const QKeySequence& key : action->shortcuts()) {
      const auto [found, isNew] = taken.emplace(key.toString(), action->text());
      EXPECT_TRUE(isNew) << key.toString().toStdString() << ": " << found->second.toStdString() << " and "
                         << action->text().toStdString();
    }
  EXPECT_GT(taken.size(), 30u);
  const KeySheet sheet(*window_.menuBar(), {}, nullptr);
  QStringList texts;
  for (const QLabel* label : sheet.findChildren<QLabel*>()) texts << label->text();
  for (const auto& [key, text] : taken)
    EXPECT_TRUE(texts.join("\n").contains(key.toHtmlEscaped())) << key.toStdString();
}

}  // namespace
}  // namespace fathom::gui
