// The plot keeps a picture of its bars: it looks as one does that was never drawn before.
#include "gui/depth_plot.h"

#include <gtest/gtest.h>

#include <QApplication>
#include <QElapsedTimer>
#include <QTest>
#include <QWheelEvent>

#include "tests/reference/deep_samples.h"

namespace fathom::gui {
namespace {

PixelSamples pixelOf(int samples, float first) {
  std::vector<reference::Sample> of;
  for (int i = 0; i < samples; ++i) {
    const float z = first + 0.37f * float(i);
    of.push_back({z, i % 2 == 0 ? z : z + 0.2f, 0.05f + 0.9f * float(i % 7) / 7, 0.5f});
  }
  deep::DeepImage image = reference::makeDeep({of}, 1);
  image.add("G", deep::PixelType::Float).values.fill(0.25f);
  const PicturePtr picture = makePicture("pixel.exr", std::move(image));
  return samplesAt(picture, {3, -2}, "RGBA", 0);
}

void wheel(DepthPlot& plot) {
  const QPointF at = plot.frame().center();
  QWheelEvent event(at, plot.mapToGlobal(at), {}, {0, 240}, {}, {}, Qt::NoScrollPhase, false);
  QApplication::sendEvent(&plot, &event);
}

// Any state of a plot, reached from one that has been drawn before, and at once.
struct Look {
  PixelSamples samples;
  QSize size{420, 220};
  bool logarithmic = false, closer = false;
  int highlight = -1;

  QImage reach(DepthPlot& plot) const {
    plot.resize(size);
    plot.setLogarithmic(logarithmic);
    plot.show(samples);
    if (closer) wheel(plot);
    plot.setHighlight(highlight);
    return plot.grab().toImage();
  }
};

TEST(DepthPlot, LooksAsOneThatIsNew) {
  const PixelSamples few = pixelOf(5, 1), many = pixelOf(400, 2);
  DepthPlot kept;
  QImage before;
  for (const Look& look :
       {Look{few}, Look{few, {420, 220}, false, false, 2}, Look{many}, Look{many, {500, 220}},
        Look{many, {500, 220}, true}, Look{many, {500, 220}, true, true}, Look{many, {500, 220}, true, true, 150}}) {
    DepthPlot fresh;
    const QImage image = look.reach(kept);
    EXPECT_EQ(image, look.reach(fresh));
    EXPECT_NE(image, before);
    before = image;
  }
}

// Of a pixel with very many samples, one that stands out or not costs no drawing of all the others.
TEST(DepthPlot, TheMouseDoesNotHaveAllBarsDrawnAgain) {
  DepthPlot plot;
  plot.resize(420, 220);
  plot.show(pixelOf(10000, 1));
  QElapsedTimer timer;
  timer.start();
  plot.grab();
  const qint64 first = timer.nsecsElapsed();
  timer.restart();
  for (int i = 0; i < 5; ++i) {
    plot.setHighlight(i);
    plot.grab();
  }
  EXPECT_LT(timer.nsecsElapsed() / 5, first / 2);
}

}  // namespace
}  // namespace fathom::gui
