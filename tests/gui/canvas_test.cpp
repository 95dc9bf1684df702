// The canvas with real mouse events: what is under the cursor stays there, what is dragged follows.
#include "gui/canvas.h"

#include <gtest/gtest.h>

#include <QTest>
#include <QWheelEvent>

#include "tests/reference/deep_samples.h"

namespace fathom::gui {
namespace {

// 16 x 12 pixels from (3, -2): the left half has a red sample at depth 2 + column, all have a blue one at 50.
PicturePtr makePicture(float red = 0.5f) {
  constexpr int kWidth = 16, kHeight = 12;
  reference::Pixels pixels(size_t(kWidth * kHeight));
  for (size_t i = 0; i < pixels.size(); ++i) {
    const int column = int(i) % kWidth;
    if (column < kWidth / 2) pixels[i].push_back({2 + float(column), 2 + float(column), 0.75f, red, 7});
    pixels[i].push_back({50, 50, 1, 0.125f, 9});
  }
  deep::DeepImage image = reference::makeDeep(pixels, kWidth);
  image.displayWindow = image.dataWindow;
  image.add("G", deep::PixelType::Float).values.fill(0);
  const Buffer<uint32_t>& ids = image.find("id")->ids;
  for (size_t i = 0; i < ids.size(); ++i) image.find(ids[i] == 7 ? "B" : "R")->values[i] = 0;
  return gui::makePicture("columns.exr", std::move(image));
}

struct CanvasTest : ::testing::Test {
  Session session;
  Canvas canvas{session, std::make_shared<const Display>()};

  void SetUp() override {
    canvas.resize(400, 300);
    canvas.show();
    ASSERT_TRUE(QTest::qWaitForWindowExposed(&canvas));
    session.setA(makePicture());
    ASSERT_TRUE(settle());
  }
  bool settle() {
    return QTest::qWaitFor([&] { return canvas.isCurrent(); }, 20000);
  }
  void setComparison(Comparison comparison) {
    ViewState view = session.view();
    view.comparison = comparison;
    session.setView(view);
  }
  // The middle of a pixel of the picture, in the widget.
  QPoint at(int x, int y) const { return canvas.viewport().toScreen(QPointF(x + 0.5, y + 0.5)).toPoint(); }
  QRgb shownAt(QPoint widget) { return canvas.grab().toImage().pixel(widget); }
  void drag(QPoint from, QPoint to, Qt::KeyboardModifiers keys = {}, Qt::MouseButton button = Qt::LeftButton) {
    QTest::mousePress(&canvas, button, keys, from);
    for (int i = 1; i <= 4; ++i) {
      const QPointF between = QPointF(from) + QPointF(to - from) * i / 4;
      QMouseEvent move(QEvent::MouseMove, between, canvas.mapToGlobal(between), Qt::NoButton, button, keys);
      QCoreApplication::sendEvent(&canvas, &move);
    }
    QTest::mouseRelease(&canvas, button, keys, to);
  }
  void wheel(QPointF where, int delta) {
    QWheelEvent event(where, canvas.mapToGlobal(where), {}, {0, delta}, Qt::NoButton, Qt::NoModifier, Qt::NoScrollPhase,
                      false);
    QCoreApplication::sendEvent(&canvas, &event);
  }
};

TEST_F(CanvasTest, FitsAndStaysFittedWhenResized) {
  EXPECT_DOUBLE_EQ(canvas.viewport().scale, 25);
  canvas.resize(200, 300);
  QTest::qWait(0);
  EXPECT_DOUBLE_EQ(canvas.viewport().scale, 12.5);
  EXPECT_EQ(at(3, -2), QPoint(6, 81));
}

TEST_F(CanvasTest, ShowsThePicture) {
  const QRgb left = shownAt(at(4, 3)), right = shownAt(at(15, 3));
  EXPECT_GT(qRed(left), qBlue(left));
  EXPECT_GT(qBlue(right), qRed(right));
}

TEST_F(CanvasTest, TheWheelKeepsThePixelUnderTheCursor) {
  const QPointF where(130.5, 77.25);
  const QPointF before = canvas.viewport().toPicture(where);
  wheel(where, 120);
  wheel(where, 120);
  EXPECT_NEAR(canvas.viewport().scale, 50, 1e-9);
  EXPECT_NEAR(canvas.viewport().toPicture(where).x(), before.x(), 1e-9);
  EXPECT_NEAR(canvas.viewport().toPicture(where).y(), before.y(), 1e-9);
  canvas.fit();
  EXPECT_DOUBLE_EQ(canvas.viewport().scale, 25);
}

TEST_F(CanvasTest, KeysZoomAroundTheCursorWhereItIs) {
  QTest::mouseMove(&canvas, {300, 200});
  const QPointF before = canvas.viewport().toPicture({300, 200});
  canvas.zoomIn();
  EXPECT_DOUBLE_EQ(canvas.viewport().scale, 50);
  EXPECT_NEAR(canvas.viewport().toPicture({300, 200}).x(), before.x(), 1e-9);
  canvas.oneToOne();
  EXPECT_DOUBLE_EQ(canvas.zoom(), 1);
}

TEST_F(CanvasTest, DraggingMovesAndDoesNotPin) {
  for (const Qt::MouseButton button : {Qt::LeftButton, Qt::MiddleButton}) {
    const QPointF before = canvas.viewport().origin;
    drag({100, 100}, {130, 85}, {}, button);
    EXPECT_EQ(canvas.viewport().origin, before + QPointF(30, -15));
    EXPECT_FALSE(session.pin());
  }
}

TEST_F(CanvasTest, ThePictureCannotBeLost) {
  for (int i = 0; i < 5; ++i) drag({10, 10}, {390, 290});
  EXPECT_LT(canvas.viewport().toScreen(QPointF(3, -2)).x(), 400);
  EXPECT_LT(canvas.viewport().toScreen(QPointF(3, -2)).y(), 300);
}

TEST_F(CanvasTest, TheCursorsPixelIsTheSessions) {
  QTest::mouseMove(&canvas, at(7, 4));
  EXPECT_EQ(session.cursor(), QPoint(7, 4));
  QEvent leave(QEvent::Leave);
  QCoreApplication::sendEvent(&canvas, &leave);
  EXPECT_FALSE(session.cursor());
}

TEST_F(CanvasTest, AClickPinsAndLetsGo) {
  QTest::mouseClick(&canvas, Qt::LeftButton, {}, at(7, 4));
  EXPECT_EQ(session.pin(), QPoint(7, 4));
  QTest::mouseClick(&canvas, Qt::LeftButton, {}, at(9, 4));
  EXPECT_EQ(session.pin(), QPoint(9, 4));
  QTest::mouseClick(&canvas, Qt::LeftButton, {}, at(9, 4));
  EXPECT_FALSE(session.pin());
}

TEST_F(CanvasTest, ShiftDragsABox) {
  drag(at(9, 6), at(5, 2), Qt::ShiftModifier);
  EXPECT_EQ(session.box(), (Box{5, 2, 10, 7}));
  EXPECT_FALSE(session.pin());
  QTest::mouseClick(&canvas, Qt::LeftButton, Qt::ShiftModifier, at(5, 5));
  EXPECT_FALSE(session.box());
}

TEST_F(CanvasTest, AltDragsTheNearPlaneAlongTheDepths) {
  const QRgb before = shownAt(at(5, 3));
  QTest::mousePress(&canvas, Qt::LeftButton, Qt::AltModifier, at(4, 3));
  EXPECT_EQ(session.view().clip.near, 3);
  QTest::mouseRelease(&canvas, Qt::LeftButton, Qt::AltModifier, at(4, 3));
  drag(at(4, 3), at(9, 3), Qt::AltModifier);
  EXPECT_EQ(session.view().clip.near, 8);
  EXPECT_FALSE(session.pin());
  ASSERT_TRUE(settle());
  const QRgb behind = shownAt(at(5, 3));
  EXPECT_NE(behind, before);
  EXPECT_GT(qBlue(behind), qRed(behind));
  EXPECT_GT(qRed(shownAt(at(9, 3))), qBlue(shownAt(at(9, 3))));  // at the plane: still there
}

TEST_F(CanvasTest, TheWipesLineIsDraggedAndDividesThePicture) {
  session.setB(makePicture(0));
  setComparison(Comparison::Wipe);
  ASSERT_TRUE(settle());
  const QPoint left = at(4, 5), right = at(8, 5);
  drag({200, 40}, {left.x() + 40, 40});
  EXPECT_NEAR(canvas.wipe(), (left.x() + 40) / 400.0, 1e-9);
  EXPECT_FALSE(session.pin());
  EXPECT_GT(qRed(shownAt(left)), 100);  // A
  EXPECT_LT(qRed(shownAt(right)), 20);  // B
  drag({left.x() + 40, 40}, {395, 40});
  EXPECT_GT(qRed(shownAt(right)), 100);
}

TEST_F(CanvasTest, SideBySideShowsTheSamePixelTwice) {
  session.setB(makePicture(0));
  setComparison(Comparison::SideBySide);
  ASSERT_TRUE(settle());
  canvas.fit();
  const QPoint a = at(5, 3), b = a + QPoint(200, 0);
  EXPECT_GT(qRed(shownAt(a)), 100);
  EXPECT_LT(qRed(shownAt(b)), 20);
  QTest::mouseMove(&canvas, b);
  EXPECT_EQ(session.cursor(), QPoint(5, 3));
}

TEST_F(CanvasTest, TogglesBetweenAAndB) {
  session.setB(makePicture(0));
  ASSERT_TRUE(settle());
  EXPECT_GT(qRed(shownAt(at(5, 3))), 100);
  setComparison(Comparison::B);
  ASSERT_TRUE(settle());
  EXPECT_LT(qRed(shownAt(at(5, 3))), 20);
}

TEST_F(CanvasTest, ValuesAreWrittenIntoLargePixels) {
  const auto colours = [&] {
    const QImage image = canvas.grab().toImage();
    const QRect pixel = canvas.viewport().toScreen(Box{12, 4, 13, 5}).toAlignedRect().adjusted(3, 3, -3, -3);
    QSet<QRgb> all;
    for (int y = pixel.top(); y <= pixel.bottom(); ++y)
      for (int x = pixel.left(); x <= pixel.right(); ++x) all.insert(image.pixel(x, y));
    return all.size();
  };
  EXPECT_EQ(colours(), 1);
  canvas.zoomTo(60);
  ASSERT_TRUE(settle());
  EXPECT_GT(colours(), 3);
}

TEST_F(CanvasTest, DifferencesAreWrittenInsteadOfWhatTheyAreOf) {
  canvas.zoomTo(60);
  const auto grabOfNoDifference = [&](float red) {
    session.setA(makePicture(red));
    session.setB(makePicture(red));
    EXPECT_TRUE(settle());
    return canvas.grab(canvas.viewport().toScreen(Box{9, 3, 12, 5}).toAlignedRect()).toImage();
  };
  for (const Comparison comparison : {Comparison::Difference, Comparison::RelativeError}) {
    setComparison(comparison);
    EXPECT_EQ(grabOfNoDifference(0.5f), grabOfNoDifference(0.25f));
  }
}

TEST_F(CanvasTest, WhatChangesIsCompositedWhereItIsSeen) {
  const Box whole = session.a()->dataWindow();
  EXPECT_EQ(canvas.shown().request.box, whole);
  canvas.zoomTo(60);
  ViewState view = session.view();
  view.clip.near = 3;
  session.setView(view);
  ASSERT_TRUE(settle());
  const Box box = canvas.shown().request.box, seen = intersect(canvas.viewport().visible(canvas.size()), whole);
  EXPECT_EQ(intersect(box, seen), seen);
  EXPECT_LT(box.area(), whole.area());
  drag({100, 100}, {101, 106});  // within what is there
  EXPECT_EQ(canvas.shown().request.box, box);
  EXPECT_TRUE(canvas.isCurrent());
  drag({10, 10}, {390, 290});
  ASSERT_TRUE(settle());
  EXPECT_EQ(canvas.shown().request.box, whole);
}

// A pixel, off the origin, of a picture with any window; and B elsewhere.
TEST_F(CanvasTest, APixelAloneAndBElsewhere) {
  const auto pixel = [](int x, int y, const char* channel) {
    flat::Image image{{x, y, x + 1, y + 1}, {-8, -6, 8, 6}, {}, {}};
    image.add(channel, 0.5f);
    return gui::makePicture("pixel.exr", std::move(image));
  };
  session.setA(pixel(-3, 2, "Y"));
  session.setB(pixel(20, 2, "Y"));  // outside of the display window
  ASSERT_TRUE(settle());
  EXPECT_EQ(shownAt(at(-3, 2)), qRgb(188, 188, 188));
  EXPECT_EQ(shownAt(at(2, 2)), qRgb(0, 0, 0));
  setComparison(Comparison::B);
  ASSERT_TRUE(settle());
  EXPECT_EQ(shownAt(at(-3, 2)), qRgb(0, 0, 0));
  canvas.zoomTo(2);
  drag({390, 150}, {10, 150});
  ASSERT_TRUE(settle());
  session.setB(pixel(2, 2, "mask"));  // no channel of A's
  ASSERT_TRUE(settle());
  session.setA(nullptr);
  session.setB(nullptr);
  session.setB(pixel(4, 4, "mask"));
  ASSERT_TRUE(settle());
  EXPECT_NE(shownAt(at(4, 4)), qRgb(0, 0, 0));
}

TEST_F(CanvasTest, APictureThatCannotBeShownLeavesNoOtherOnTheScreen) {
  QStringList said;
  QObject::connect(&session, &Session::said, &canvas, [&](const QString& line) { said << line; });
  deep::DeepImage image = session.a()->deep()->copy();
  image.erase("Z");
  session.setA(gui::makePicture("broken.exr", std::move(image)));
  ASSERT_TRUE(QTest::qWaitFor([&] { return !said.isEmpty(); }, 20000));
  EXPECT_TRUE(canvas.shown().a.isNull());
  EXPECT_LT(qRed(shownAt(at(4, 3))), 20);
  session.setA(makePicture());
  ASSERT_TRUE(settle());
  EXPECT_GT(qRed(shownAt(at(4, 3))), 100);
}

TEST_F(CanvasTest, OfAVeryLargePictureOnlyWhatIsSeenAndItsSurroundingsAreAskedFor) {
  const Box window{0, 0, 4000, 3000};
  flat::Image image{window, window, {}, {}};
  image.add("Y", 0.5f);
  session.setA(gui::makePicture("large.exr", std::move(image)));
  canvas.oneToOne();
  ASSERT_TRUE(settle());
  const auto seen = [&] { return intersect(canvas.viewport().visible(canvas.size()), window); };
  const auto holdsSeen = [&] { return intersect(canvas.shown().request.box, seen()) == seen(); };
  const Box first = canvas.shown().request.box;
  EXPECT_TRUE(holdsSeen());
  EXPECT_LT(first.area(), window.area() / 20);
  drag({200, 150}, {190, 145});
  ASSERT_TRUE(settle());
  EXPECT_EQ(canvas.shown().request.box, first);
  drag({300, 150}, {0, 145});
  ASSERT_TRUE(settle());
  EXPECT_NE(canvas.shown().request.box, first);
  EXPECT_TRUE(holdsSeen());
  canvas.fit();
  ASSERT_TRUE(settle());
  EXPECT_EQ(canvas.shown().request.box, window);
  EXPECT_GT(canvas.shown().step, 1);
}

TEST_F(CanvasTest, WithoutPicturesNothingIsShown) {
  session.setA(nullptr);
  EXPECT_TRUE(canvas.isCurrent());
  EXPECT_TRUE(canvas.shown().a.isNull());
  canvas.grab();
}

}  // namespace
}  // namespace fathom::gui
