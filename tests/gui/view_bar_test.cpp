// The bar above the picture, by its keys and fields.
#include "gui/view_bar.h"

#include <gtest/gtest.h>

#include <QAction>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QtTest>

namespace fathom::gui {
namespace {

PicturePtr picture(const std::vector<std::string>& channels) {
  const Box window{0, 0, 1, 1};
  deep::DeepImage image{window, window, Buffer<uint64_t>(2, 0), {}, {}};
  for (const std::string& name : channels) image.add(name, deep::PixelType::Float);
  return makePicture("a.exr", std::move(image));
}

class ViewBarTest : public ::testing::Test {
 protected:
  ViewBarTest() : bar_(session_, std::make_shared<Display>()) {
    session_.setA(picture({"A", "B", "G", "R", "Z", "N.X", "N.Y", "N.Z"}));
    bar_.show();
  }
  std::string layer() const { return session_.view().layer; }
  Session session_;
  ViewBar bar_;
};

TEST_F(ViewBarTest, ListsTheLayersOfThePicture) {
  auto* layers = bar_.findChildren<QComboBox*>()[0];
  EXPECT_EQ(layers->count(), 4);  // RGBA, Z, N, samples per pixel
  EXPECT_EQ(layers->currentText(), "RGBA");
  session_.setA(picture({"A", "Z"}));
  EXPECT_EQ(layers->count(), 3);
}

TEST_F(ViewBarTest, StepsThroughLayersInACircle) {
  bar_.nextLayer();
  EXPECT_EQ(layer(), "Z");
  bar_.previousLayer();
  bar_.previousLayer();
  EXPECT_EQ(layer(), "samples per pixel");
}

TEST_F(ViewBarTest, AChannelAloneAndBack) {
  QAction* red = bar_.isolateActions()[1];
  red->trigger();
  EXPECT_EQ(session_.view().isolate, Isolate::Red);
  EXPECT_TRUE(red->isChecked());
  red->trigger();
  EXPECT_EQ(session_.view().isolate, Isolate::All);
  EXPECT_TRUE(bar_.isolateActions()[0]->isChecked());
}

TEST_F(ViewBarTest, TypedExposureIsTheView) {
  auto* exposure = bar_.findChildren<QDoubleSpinBox*>()[0];
  exposure->selectAll();
  QTest::keyClicks(exposure, "1.5");
  QTest::keyClick(exposure, Qt::Key_Return);
  EXPECT_EQ(session_.view().display.exposure, 1.5f);
  bar_.changeExposure(-0.5);
  EXPECT_EQ(exposure->value(), 1);
}

TEST_F(ViewBarTest, ADisplayBringsItsOwnViews) {
  const Display display;
  auto* displays = bar_.findChildren<QComboBox*>()[1];
  auto* views = bar_.findChildren<QComboBox*>()[2];
  ASSERT_EQ(displays->count(), int(display.displays().size()));
  ASSERT_GT(displays->count(), 1);
  emit displays->activated(1);
  EXPECT_EQ(session_.view().display.display, display.displays()[1]);
  EXPECT_EQ(views->count(), int(display.views(display.displays()[1]).size()));
}

TEST_F(ViewBarTest, ChoicesAreListedAnewOnlyWhereTheyChange) {
  auto* displays = bar_.findChildren<QComboBox*>()[1];
  QSignalSpy listed(displays->model(), &QAbstractItemModel::rowsInserted);
  bar_.changeExposure(1);
  EXPECT_EQ(listed.size(), 0);
}

TEST_F(ViewBarTest, SmallEndsOfFalseColoursAreSeen) {
  auto* from = bar_.findChildren<QDoubleSpinBox*>()[2];
  ViewState view = session_.view();
  view.display.low = 0.00125f;
  session_.setView(view);
  EXPECT_EQ(from->text(), QLocale().toString(0.00125, 'f', 5));
  view.display.low = 20;
  session_.setView(view);
  EXPECT_EQ(from->text(), "20");
}

TEST_F(ViewBarTest, TheEndsOfFalseColoursShowWithThem) {
  auto* from = bar_.findChildren<QDoubleSpinBox*>()[2];
  const auto shown = [&] {
    for (QAction* action : bar_.actions())
      if (bar_.widgetForAction(action) == from) return action->isVisible();
    return false;
  };
  EXPECT_FALSE(shown());
  bar_.nextLayer();  // Z
  EXPECT_TRUE(shown());
}

}  // namespace
}  // namespace fathom::gui
