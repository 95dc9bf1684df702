// The depth panel under a mouse and keys.
#include "gui/depth_panel.h"

#include <gtest/gtest.h>

#include <QAction>
#include <QSignalSpy>
#include <QTest>
#include <QWheelEvent>
#include <limits>

#include "gui/depth_field.h"
#include "gui/histogram_view.h"

namespace fathom::gui {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A pixel with points at these depths.
PicturePtr pictureOf(const std::vector<float>& depths) {
  const Box window{0, 0, 1, 1};
  deep::DeepImage image{window, window, Buffer<uint64_t>(2, 0), {}, {}};
  image.offsets[1] = depths.size();
  std::ranges::copy(depths, image.add("Z", deep::PixelType::Float).values.begin());
  image.add("A", deep::PixelType::Float).values.fill(0.5f);
  return makePicture("test.exr", std::move(image));
}

struct DepthPanelTest : ::testing::Test {
  Session session;
  DepthPanel panel{session};
  HistogramView* view = panel.findChild<HistogramView*>();

  void SetUp() override {
    panel.resize(800, 200);
    panel.show();
    open({1, 2, 9});
  }
  void open(const std::vector<float>& depths) {
    QSignalSpy shown(&panel, &DepthPanel::histogramChanged);
    session.setA(pictureOf(depths));
    ASSERT_TRUE(!shown.empty() || shown.wait());
  }
  const deep::DepthRange& clip() const { return session.view().clip; }
  void setClip(const deep::DepthRange& range) {
    ViewState state = session.view();
    state.clip = range;
    session.setView(state);
  }
  DepthField* field(const char* name) { return panel.findChild<DepthField*>(name); }
  QAction* action(const QString& text) {
    for (QAction* one : panel.findChildren<QAction*>())
      if (one->text() == text) return one;
    return nullptr;
  }
  void drag(double from, double to) {
    const auto point = [&](double x) { return QPoint(int(std::lround(x)), view->height() / 2); };
    QTest::mousePress(view, Qt::LeftButton, {}, point(from));
    QTest::mouseMove(view, point((from + to) / 2));
    QTest::mouseMove(view, point(to));
    QTest::mouseRelease(view, Qt::LeftButton, {}, point(to));
  }
  void type(const char* name, const QString& text) {
    field(name)->selectAll();
    QTest::keyClicks(field(name), text);
    QTest::keyClick(field(name), Qt::Key_Return);
  }
};

TEST_F(DepthPanelTest, ADraggedHandleMovesItsPlane) {
  setClip({3, 7});
  drag(view->xOf(3) - 3, view->xOf(4) - 3);
  EXPECT_NEAR(clip().near, 4, 0.03);
  EXPECT_EQ(clip().far, 7);
  drag(view->xOf(7) + 3, view->xOf(6) + 3);
  EXPECT_NEAR(clip().far, 6, 0.03);
  const float near = clip().near;
  drag(view->xOf(5), view->xOf(7));  // the slab
  EXPECT_NEAR(clip().near, near + 2, 0.03);
  EXPECT_NEAR(clip().far, 8, 0.05);
}

TEST_F(DepthPanelTest, AnOpenHandleIsTakenFromTheEndAndOpensThere) {
  const double left = view->xOf(view->depthAt(0)) + 14, begin = view->xOf(1);
  drag(left, begin + 40);
  EXPECT_GT(clip().near, 1);
  EXPECT_LT(clip().near, 3);
  drag(view->xOf(double(clip().near)) - 3, 0);
  EXPECT_EQ(clip().near, -kInfinity);
}

TEST_F(DepthPanelTest, TypedValuesAreTaken) {
  type("near", "2.5");
  EXPECT_EQ(clip().near, 2.5f);
  type("far", "6");
  type("soft", "0.25");
  EXPECT_EQ(clip(), (deep::DepthRange{2.5f, 6, 0.25f}));
  type("near", "-inf");
  type("far", "inf");
  EXPECT_EQ(clip().near, -kInfinity);
  EXPECT_EQ(clip().far, kInfinity);
  type("near", "nonsense");
  EXPECT_EQ(clip().near, -kInfinity);
  EXPECT_EQ(field("near")->text(), "-inf");
  type("soft", "-1");
  EXPECT_EQ(clip().soft, 0.25f);
}

TEST_F(DepthPanelTest, FieldsShowTheRangeAndStep) {
  setClip({1.2345678f, 6});
  EXPECT_EQ(field("near")->text(), "1.23457");
  QTest::keyClick(field("near"), Qt::Key_Return);  // what is shown has fewer digits, and says nothing
  EXPECT_EQ(clip().near, 1.2345678f);
  QTest::keyClick(field("near"), Qt::Key_Up);
  EXPECT_GT(clip().near, 1.2345678f);
}

TEST_F(DepthPanelTest, InvertAndReset) {
  setClip({2, 6});
  action("Invert")->trigger();
  EXPECT_EQ(clip(), (deep::DepthRange{2, 6, 0, true}));
  action("Reset")->trigger();
  EXPECT_EQ(clip(), deep::DepthRange());
  EXPECT_FALSE(action("Invert")->isChecked());
}

TEST_F(DepthPanelTest, AnimationSweepsUntilAHandMovesAPlane) {
  QSignalSpy changed(&session, &Session::viewChanged);
  action("Animate")->trigger();
  ASSERT_TRUE(changed.wait());
  const float first = clip().near;
  EXPECT_TRUE(std::isfinite(first));
  ASSERT_TRUE(QTest::qWaitFor([&] { return clip().near > first; }));
  type("near", "5");
  EXPECT_FALSE(action("Animate")->isChecked());
  EXPECT_EQ(clip().near, 5);
  action("Animate")->trigger();
  setClip({7, kInfinity});  // as if dragged in the picture
  EXPECT_FALSE(action("Animate")->isChecked());
}

TEST_F(DepthPanelTest, TheWheelZoomsAroundTheCursor) {
  const double x = view->xOf(4);
  QWheelEvent wheel(QPointF(x, 30), view->mapToGlobal(QPointF(x, 30)), {}, {0, 240}, {}, {}, Qt::NoScrollPhase, false);
  QSignalSpy shown(&panel, &DepthPanel::histogramChanged);
  QCoreApplication::sendEvent(view, &wheel);
  EXPECT_NEAR(view->depthAt(x), 4, 1e-9);
  EXPECT_GT(view->xOf(5) - view->xOf(4), 1.5 * (800 - 40) / 8.7);
  ASSERT_TRUE(shown.wait());
  QTest::mouseDClick(view, Qt::LeftButton, {}, QPoint(300, 40));
  EXPECT_LT(view->depthAt(0), 1);
}

TEST_F(DepthPanelTest, LogarithmicDepthPutsRatiosSideBySide) {
  QSignalSpy shown(&panel, &DepthPanel::histogramChanged);
  action("Log depth")->trigger();
  ASSERT_TRUE(shown.wait());
  EXPECT_NEAR(view->xOf(3) - view->xOf(1), view->xOf(9) - view->xOf(3), 1e-6);
}

TEST_F(DepthPanelTest, BarsStandWhereSamplesAre) {
  action("Log counts")->setChecked(false);
  // How many of the columns around a depth are not the ground, a third above the axis.
  const auto bars = [&](double depth) {
    const QImage image = view->grab().toImage();
    const double scale = image.devicePixelRatio();
    const auto at = [&](double x) { return image.pixel(int(x * scale), int(0.6 * view->height() * scale)); };
    int count = 0;
    for (int dx = -3; dx <= 3; ++dx) count += at(view->xOf(depth) + dx) != at(view->xOf(5.5));
    return count;
  };
  for (const double depth : {1.0, 2.0}) EXPECT_GT(bars(depth), 0) << depth;
  // The last sample adds a quarter of what the first does.
  for (const double depth : {1.5, 4.0, 7.0, 9.0}) EXPECT_EQ(bars(depth), 0) << depth;
  action("Log counts")->setChecked(true);
  EXPECT_GT(bars(9), 0);
}

TEST_F(DepthPanelTest, ThePlanesColourTheBars) {
  const auto pixel = [&](const deep::DepthRange& range, double x) {
    setClip(range);
    const QImage image = view->grab().toImage();
    return image.pixel(int(x * image.devicePixelRatio()), int(0.75 * view->height() * image.devicePixelRatio()));
  };
  // Within the bar at depth 1.
  double x = view->xOf(1) - 3;
  while (x < view->xOf(1) + 3 && pixel({}, x) == pixel({}, view->xOf(1.5))) ++x;
  const auto bar = [&](const deep::DepthRange& range) { return pixel(range, x); };
  const QRgb kept = bar({-kInfinity, 6}), removed = bar({4, 6});
  EXPECT_NE(kept, removed);
  EXPECT_EQ(bar({5, 6}), removed);
  EXPECT_EQ(bar({4, 6, 0, true}), kept);
}

TEST_F(DepthPanelTest, WhereBAloneIsShownTheDepthsAreOfB) {
  session.setB(pictureOf({100, 200}));
  QSignalSpy shown(&panel, &DepthPanel::histogramChanged);
  ViewState state = session.view();
  state.comparison = Comparison::B;
  session.setView(state);
  ASSERT_TRUE(shown.wait());
  EXPECT_GT(view->depthAt(40), 50);
}

TEST_F(DepthPanelTest, AHiddenPanelCountsNothing) {
  QSignalSpy shown(&panel, &DepthPanel::histogramChanged);
  panel.hide();
  session.setA(pictureOf({100, 200}));
  EXPECT_FALSE(shown.wait(50));
  panel.show();
  EXPECT_TRUE(shown.wait());
  EXPECT_GT(view->depthAt(40), 50);
}

TEST_F(DepthPanelTest, AHiddenPanelAnimatesThroughTheDepthsOfThePicture) {
  panel.hide();
  session.setA(pictureOf({100, 200}));
  action("Animate")->trigger();
  EXPECT_TRUE(QTest::qWaitFor([&] { return clip().near > 90; }));
}

TEST_F(DepthPanelTest, WithoutDepthsNothingIsAnimated) {
  EXPECT_TRUE(action("Animate")->isEnabled());
  session.setA(nullptr);
  EXPECT_FALSE(action("Animate")->isEnabled());
}

TEST_F(DepthPanelTest, APartOfOtherDepthsIsNotKept) {
  const double x = view->xOf(4);
  QWheelEvent wheel(QPointF(x, 30), view->mapToGlobal(QPointF(x, 30)), {}, {0, 240}, {}, {}, Qt::NoScrollPhase, false);
  QCoreApplication::sendEvent(view, &wheel);
  open({100, 200});
  EXPECT_TRUE(QTest::qWaitFor([&] { return view->depthAt(40) > 50; }));
  EXPECT_LT(view->depthAt(700), 300);
}

TEST_F(DepthPanelTest, AnotherPictureHasItsOwnDepths) {
  open({100, 200});
  EXPECT_GT(view->depthAt(40), 50);
  session.setA(nullptr);
  EXPECT_FALSE(panel.isEnabled());
  open({1, 2});
  EXPECT_TRUE(panel.isEnabled());
  EXPECT_LT(view->depthAt(700), 3);
}

}  // namespace
}  // namespace fathom::gui
