// The canvas counts in the screen's own pixels, of which a unit may have several: also run with QT_SCALE_FACTOR=2.
#include <gtest/gtest.h>

#include <QGuiApplication>
#include <QMouseEvent>
#include <QTest>

#include "gui/canvas.h"

namespace fathom::gui {
namespace {

// Red says the column, green the row, in steps of 8 bits.
PicturePtr makePicture(int width, int height) {
  const Box window{0, 0, width, height};
  flat::Image image{window, window, {}, {}};
  for (const char* name : {"R", "G", "B"}) image.add(name, 0.0f);
  Buffer<float>&red = image.find("R")->values, &green = image.find("G")->values;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      red[window.index(x, y)] = float(x % 256) / 255;
      green[window.index(x, y)] = float(y % 256) / 255;
    }
  return gui::makePicture("columns.exr", std::move(image));
}

struct DevicePixels : ::testing::Test {
  Session session;
  Canvas canvas{session, std::make_shared<const Display>()};
  const double ratio = qGuiApp->devicePixelRatio();

  void open(int width, int height) {
    EXPECT_EQ(ratio, qEnvironmentVariableIsSet("QT_SCALE_FACTOR") ? qgetenv("QT_SCALE_FACTOR").toDouble() : 1);
    canvas.resize(300, 200);
    canvas.show();
    ASSERT_TRUE(QTest::qWaitForWindowExposed(&canvas));
    session.setA(makePicture(width, height));
    ViewState view;
    view.display.view = "Raw";
    session.setView(view);
    settle();
  }
  void settle() {
    ASSERT_TRUE(QTest::qWaitFor([this] { return canvas.isCurrent(); }, 20000));
  }
};

TEST_F(DevicePixels, OneToOneIsAPixelOfTheScreenForEach) {
  open(2000, 1500);
  canvas.oneToOne();
  settle();
  EXPECT_EQ(canvas.zoom(), 1);
  EXPECT_EQ(canvas.viewport().scale, 1 / ratio);
  EXPECT_EQ(canvas.shown().pixelSize, 1);
  const QImage image = canvas.grab().toImage();
  ASSERT_EQ(image.width(), int(300 * ratio));
  const QRgb first = image.pixel(20, 30);
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ((qRed(image.pixel(20 + i, 30)) - qRed(first) + 256) % 256, i);
    EXPECT_EQ((qGreen(image.pixel(20, 30 + i)) - qGreen(first) + 256) % 256, i);
  }
}

TEST_F(DevicePixels, TheMouseIsOverThePixelThatIsDrawnThere) {
  open(200, 150);
  for (const double zoom : {4.0, 8.0}) {
    canvas.zoomTo(zoom);
    settle();
    const QImage image = canvas.grab().toImage();
    for (const QPoint pixel : {QPoint(100, 75), QPoint(93, 66), QPoint(110, 80)}) {
      const QPointF at = canvas.viewport().toScreen(QPointF(pixel) + QPointF(0.5, 0.5));
      QMouseEvent move(QEvent::MouseMove, at, canvas.mapToGlobal(at), Qt::NoButton, Qt::NoButton, {});
      QCoreApplication::sendEvent(&canvas, &move);
      EXPECT_EQ(session.cursor(), pixel);
      const QRgb drawn = image.pixel(QPoint(int(at.x() * ratio), int(at.y() * ratio)));
      EXPECT_EQ(QPoint(qRed(drawn), qGreen(drawn)), pixel);
    }
  }
}

TEST_F(DevicePixels, WhatFitsIsAsFineAsTheScreen) {
  open(2400, 1600);
  EXPECT_EQ(canvas.shown().pixelSize, ratio >= 2 ? 4 : 8);
}

}  // namespace
}  // namespace fathom::gui
