// The line below the picture.
#include "gui/info_bar.h"

#include <gtest/gtest.h>

#include <QTest>

#include "tests/reference/deep_samples.h"

namespace fathom::gui {
namespace {

// Two pixels: one with two samples, and one with `many`.
PicturePtr makePicture(int many = 1) {
  reference::Pixels pixels(2);
  pixels[0] = {{2, 2, 0.75f, 0.5f, 7}, {50, 50, 1, 0, 9}};
  for (int i = 0; i < many; ++i) pixels[1].push_back({float(1 + i), float(1 + i), 0, 0, 7});
  deep::DeepImage image = reference::makeDeep(pixels, 2);
  image.add("G", deep::PixelType::Float).values.fill(0);
  image.add("B", deep::PixelType::Float).values.fill(0);
  return gui::makePicture("two.exr", std::move(image));
}

TEST(InfoBar, TellsThePixel) {
  Session session;
  const InfoBar bar(session);
  EXPECT_EQ(bar.text(), "");
  session.setA(makePicture());
  const Box& window = session.a()->dataWindow();
  session.setCursor(QPoint(window.x0, window.y0));
  const QString text = bar.text();
  EXPECT_TRUE(text.startsWith(QString("%1, %2").arg(window.x0).arg(window.y0))) << text.toStdString();
  EXPECT_TRUE(text.contains("R 0.5   G 0   B 0   A 1")) << text.toStdString();
  EXPECT_TRUE(text.contains("2 samples")) << text.toStdString();
  session.setCursor(QPoint(500, 3));
  EXPECT_TRUE(bar.text().contains("outside")) << bar.text().toStdString();
}

TEST(InfoBar, APixelWithVeryManySamplesDoesNotHoldTheWindowUp) {
  Session session;
  InfoBar bar(session);
  bar.resize(600, 24);
  bar.show();
  session.setA(makePicture(3000));
  const Box& window = session.a()->dataWindow();
  const QPoint few(window.x0, window.y0), many(window.x0 + 1, window.y0);
  session.setCursor(many);
  bar.grab();
  EXPECT_FALSE(bar.line().contains("samples")) << bar.line().toStdString();
  EXPECT_TRUE(QTest::qWaitFor([&] { return bar.line().contains("3000 samples"); })) << bar.line().toStdString();
  // What comes late is not shown with another pixel.
  session.setCursor(few);
  session.setCursor(many);
  bar.grab();
  session.setCursor(few);
  bar.grab();
  EXPECT_TRUE(bar.line().contains("2 samples"));
  QTest::qWait(100);
  EXPECT_TRUE(bar.line().contains("2 samples")) << bar.line().toStdString();
}

}  // namespace
}  // namespace fathom::gui
