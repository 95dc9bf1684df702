// How A and B are shown and measured, and a volume placed in A.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <QDoubleSpinBox>
#include <QTableWidget>
#include <QTest>
#include <QToolButton>

#include "base/error.h"
#include "deep/compare.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "deep/ops/insert.h"
#include "flat/io.h"
#include "gui/compare_panel.h"
#include "gui/inspector_panel.h"
#include "gui/place_panel.h"
#include "tests/reference/random_deep.h"
#include "tests/reference/rendered_frame.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::gui {
namespace {

bool waitFor(const std::function<bool()>& condition) {
  return QTest::qWaitFor(condition, 60000);
}

class PanelsTest : public ::testing::Test {
 protected:
  PanelsTest() : frames_(session_) {
    QObject::connect(&session_, &Session::said, [this](const QString& line) { said_ = line; });
    reference::RenderedFrame frame = reference::renderFrame();
    deep::write(folder_ / "noisy.exr", frame.noisy);
    deep::write(folder_ / "truth.exr", frame.truth);
    deep::write(folder_ / "other.exr", reference::renderFrame({.seed = 2, .volumes = true}).truth);
  }
  QString path(const char* name) { return QString::fromStdString(folder_ / name); }
  void open(const char* a, const char* b = nullptr) {
    frames_.open(path(a));
    if (b) frames_.openB(path(b));
    ASSERT_TRUE(waitFor([&] { return session_.a() && (!b || session_.b()); }));
  }

  TemporaryFolder folder_;
  Session session_;
  Frames frames_;
  QString said_;
};

TEST_F(PanelsTest, NumbersAreThoseOfTheCommand) {
  open("noisy.exr", "truth.exr");
  const ComparedNumbers numbers = compareNumbers(*session_.a(), *session_.b(), {6});
  const deep::DeepMetrics expected = deep::compare(*session_.a()->deep(), *session_.b()->deep(), {.clips = {6}});
  ASSERT_EQ(numbers.parts.size(), 4u);
  EXPECT_EQ(numbers.parts[0].relMse, expected.flattened.relMse);
  EXPECT_EQ(numbers.parts[1].relMse, expected.bins.relMse);
  EXPECT_EQ(numbers.parts[2].name, "in front of 6");
  EXPECT_EQ(numbers.parts[3].psnr, expected.clips[0].behind->psnr);
}

TEST_F(PanelsTest, OtherBinsAreComparedFlattened) {
  open("noisy.exr", "other.exr");
  const ComparedNumbers numbers = compareNumbers(*session_.a(), *session_.b(), {});
  ASSERT_EQ(numbers.parts.size(), 1u);
  EXPECT_GT(numbers.parts[0].relMse, 0);
  ASSERT_EQ(numbers.notes.size(), 1u);
  EXPECT_THAT(numbers.notes[0], ::testing::StartsWith("flattened only"));
}

TEST_F(PanelsTest, ADeepImageIsComparedWithAFlatOne) {
  flat::write(folder_ / "flat.exr", deep::flatten(deep::read(folder_ / "truth.exr")));
  open("noisy.exr", "flat.exr");
  const auto flat = compareNumbers(*session_.a(), *session_.b(), {});
  const auto deep = compareNumbers(*session_.a(), *loadPicture(folder_ / "truth.exr"), {});
  ASSERT_EQ(flat.parts.size(), 1u);
  EXPECT_FLOAT_EQ(float(flat.parts[0].relMse), float(deep.parts[0].relMse));
}

TEST_F(PanelsTest, ThePanelShowsModesAndNumbers) {
  ComparePanel panel(session_, frames_);
  panel.show();
  auto* table = panel.findChild<QTableWidget*>();
  EXPECT_FALSE(panel.modeActions()[2]->isEnabled());
  open("noisy.exr", "truth.exr");
  ASSERT_TRUE(waitFor([&] { return table->columnCount() == 2; }));
  EXPECT_EQ(table->item(0, 0)->text().size(), 7);
  EXPECT_EQ(table->item(3, 1)->text(), "–");  // there is no PSNR per bin
  const auto buttons = panel.findChildren<QToolButton*>();
  const auto wipe = std::ranges::find(buttons, QString("Wipe"), &QToolButton::text);
  ASSERT_NE(wipe, buttons.end());
  QTest::mouseClick(*wipe, Qt::LeftButton);
  EXPECT_EQ(session_.view().comparison, Comparison::Wipe);
  panel.toggle();
  EXPECT_EQ(session_.view().comparison, Comparison::A);
  panel.toggle();
  EXPECT_EQ(session_.view().comparison, Comparison::B);
  EXPECT_TRUE(panel.modeActions()[1]->isChecked());
  ViewState view = session_.view();
  view.clip.near = 6;
  session_.setView(view);
  ASSERT_TRUE(waitFor([&] { return table->columnCount() == 4; }));
  const QString before = table->item(0, 0)->text();
  QTest::mouseClick(panel.findChild<QWidget*>("swap"), Qt::LeftButton);
  EXPECT_EQ(session_.a()->path, folder_ / "truth.exr");
  ASSERT_TRUE(waitFor([&] { return table->item(0, 0) && table->item(0, 0)->text() != before; }));
  QTest::mouseClick(panel.findChild<QWidget*>("closeB"), Qt::LeftButton);
  EXPECT_FALSE(session_.b());
  EXPECT_EQ(table->columnCount(), 0);
  EXPECT_EQ(session_.view().comparison, Comparison::A);
}

TEST_F(PanelsTest, APanelThatIsHiddenHoldsNoPictures) {
  ComparePanel panel(session_, frames_);
  panel.show();
  session_.setPictures(loadPicture(folder_ / "noisy.exr"), loadPicture(folder_ / "truth.exr"));
  ASSERT_TRUE(waitFor([&] { return panel.findChild<QTableWidget*>()->columnCount() == 2; }));
  panel.hide();
  const std::weak_ptr<const Picture> a = session_.a(), b = session_.b();
  session_.setPictures(loadPicture(folder_ / "other.exr"), loadPicture(folder_ / "other.exr"));
  EXPECT_TRUE(waitFor([&] { return a.expired() && b.expired(); }));
}

TEST_F(PanelsTest, AVolumeIsPlacedMovedAndRemoved) {
  open("noisy.exr");
  const PicturePtr original = session_.a();
  Placement placement(session_, frames_);
  PlacePanel panel(session_, placement);
  panel.resize(400, 300);
  panel.show();
  const auto placedAs = [&](const deep::Transform& transform) {
    const deep::DeepImage expected =
        deep::insert(original->deep()->copy(), deep::read(folder_ / "other.exr"), transform);
    return waitFor([&] { return !placement.busy(); }) && session_.a()->deep() &&
           reference::difference(*session_.a()->deep(), expected).empty();
  };
  placement.open(path("other.exr"));
  EXPECT_TRUE(placedAs({}));
  EXPECT_EQ(frames_.originalA(), original);
  auto* number = panel.findChild<QDoubleSpinBox*>("depthNumber");
  number->selectAll();
  QTest::keyClicks(number, "-1.5");
  QTest::keyClick(number, Qt::Key_Return);
  EXPECT_TRUE(placedAs({.z = -1.5}));
  auto* slider = panel.findChild<QSlider*>("xSlider");
  QTest::keyClick(slider, Qt::Key_End);
  EXPECT_TRUE(placedAs({.x = 48, .z = -1.5}));
  QTest::mouseClick(panel.findChild<QWidget*>("asRendered"), Qt::LeftButton);
  EXPECT_TRUE(placedAs({}));
  EXPECT_EQ(number->value(), 0);
  frames_.openB(path("truth.exr"));  // gets it, too
  ASSERT_TRUE(waitFor([&] { return session_.b() != nullptr; }));
  EXPECT_EQ(session_.b()->deep()->samples(), session_.a()->deep()->samples());
  QTest::mouseClick(panel.findChild<QWidget*>("removeVolume"), Qt::LeftButton);
  EXPECT_EQ(session_.b()->deep()->samples(), original->deep()->samples());
  EXPECT_EQ(session_.a(), original);
  EXPECT_FALSE(placement.active());
}

TEST_F(PanelsTest, WithoutAnAThereIsNothingToPlaceIn) {
  Placement placement(session_, frames_);
  placement.open(path("other.exr"));
  frames_.openB(path("noisy.exr"));  // as A, then
  ASSERT_TRUE(waitFor([&] { return session_.a() && !placement.busy(); }));
  EXPECT_GT(session_.a()->deep()->samples(), frames_.originalA()->deep()->samples());
  EXPECT_FALSE(session_.b());
  // B stays alone where A cannot be read.
  Session session;
  Frames frames(session);
  Placement alone(session, frames);
  frames.open(path("nothing.exr"));
  frames.openB(path("noisy.exr"));
  alone.open(path("other.exr"));
  ASSERT_TRUE(waitFor([&] { return session.b() && !alone.busy(); }));
  EXPECT_FALSE(session.a());
}

TEST_F(PanelsTest, WhatCannotBePlacedIsSaidAndAStaysAsItIs) {
  open("noisy.exr");
  const PicturePtr original = session_.a();
  Placement placement(session_, frames_);
  placement.open(path("nothing.####.exr"));
  EXPECT_TRUE(said_.contains("nothing"));
  EXPECT_FALSE(placement.active());
  placement.open(path("nothing.exr"));
  ASSERT_TRUE(waitFor([&] { return said_.contains("nothing.exr"); }));
  EXPECT_EQ(session_.a(), original);
}

}  // namespace
}  // namespace fathom::gui
