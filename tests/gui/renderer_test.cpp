// Answers in the background: what is stale is dropped, what is kept is not made twice.
#include "gui/renderer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <QTest>
#include <limits>
#include <vector>

#include "base/error.h"
#include "tests/reference/deep_samples.h"

namespace fathom::gui {
namespace {

using ::testing::ElementsAre;

// Two samples in every pixel: one at depth 2, red, in front of one at 5, blue.
PicturePtr makePicture(int width, int height, float red = 0.5f) {
  reference::Pixels pixels(size_t(width) * size_t(height), {{2, 2, 0.5f, red, 7}, {5, 5, 1, 0.25f, 9}});
  deep::DeepImage image = reference::makeDeep(pixels, width);
  deep::Channel& green = image.add("G", deep::PixelType::Float);
  green.values.fill(0);
  return gui::makePicture("two.exr", std::move(image));
}

RenderRequest requestFor(const PicturePtr& picture, float exposure = 0) {
  RenderRequest request{picture, nullptr, {}, picture->dataWindow()};
  request.state.display.exposure = exposure;
  return request;
}

struct Answers {
  explicit Answers(Renderer& renderer) {
    QObject::connect(&renderer, &Renderer::rendered, &renderer, [this](const Rendered& r) { results.push_back(r); });
    QObject::connect(&renderer, &Renderer::failed, &renderer, [this](const QString& line) { lines << line; });
  }
  // Until the whole answer to that exposure has come.
  bool waitFor(float exposure) {
    const auto came = [&] {
      return !results.empty() && results.back().request.state.display.exposure == exposure &&
             results.back().step == results.back().request.step;
    };
    return QTest::qWaitFor(came, 20000);
  }
  std::vector<float> exposures() const {
    std::vector<float> all;
    for (const Rendered& r : results)
      if (all.empty() || all.back() != r.request.state.display.exposure)
        all.push_back(r.request.state.display.exposure);
    return all;
  }

  std::vector<Rendered> results;
  QStringList lines;
};

std::shared_ptr<const Display> display() {
  static const auto the = std::make_shared<const Display>();
  return the;
}

TEST(Renderer, OfManyRequestsTheFirstAndTheNewestAreAnswered) {
  Renderer renderer(display());
  Answers answers(renderer);
  const PicturePtr picture = makePicture(64, 48);
  for (int i = 1; i <= 9; ++i) renderer.request(requestFor(picture, float(i)));
  ASSERT_TRUE(answers.waitFor(9));
  QTest::qWait(0);
  EXPECT_THAT(answers.exposures(), ElementsAre(1, 9));
}

// Large enough for a quick answer before the whole one.
PicturePtr makeLarge() {
  flat::Image image{{0, 0, 1000, 600}, {0, 0, 1000, 600}, {}, {}};
  for (const char* name : {"R", "G", "B"}) image.add(name, 0.5f);
  return gui::makePicture("large.exr", std::move(image));
}

TEST(Renderer, AQuickAnswerComesBeforeTheWholeOne) {
  Renderer renderer(display());
  Answers answers(renderer);
  renderer.request(requestFor(makeLarge(), 1));
  ASSERT_TRUE(answers.waitFor(1));
  ASSERT_EQ(answers.results.size(), 2u);
  EXPECT_GT(answers.results[0].step, 1);
  EXPECT_LT(answers.results[0].a.width(), answers.results[1].a.width());
}

TEST(Renderer, AWholeAnswerThatIsStaleIsDropped) {
  Renderer renderer(display());
  Answers answers(renderer);
  const PicturePtr picture = makeLarge();
  QObject::connect(&renderer, &Renderer::rendered, &renderer, [&](const Rendered& result) {
    if (result.request.state.display.exposure == 1) renderer.request(requestFor(picture, 2));
  });
  renderer.request(requestFor(picture, 1));
  ASSERT_TRUE(answers.waitFor(2));
  EXPECT_GT(answers.results[0].step, 1);
  for (const Rendered& result : answers.results)
    EXPECT_TRUE(result.request.state.display.exposure == 2 || result.step > 1);
}

TEST(Renderer, AnAnswerToNothingDoesNotCome) {
  Renderer renderer(display());
  Answers answers(renderer);
  const PicturePtr picture = makePicture(64, 48);
  renderer.request(requestFor(picture, 1));
  renderer.request({});
  renderer.request(requestFor(picture, 2));
  ASSERT_TRUE(answers.waitFor(2));
  EXPECT_THAT(answers.exposures(), ElementsAre(2));
}

TEST(Renderer, AFailureIsALineAndTheNextRequestIsAnswered) {
  Renderer renderer(display());
  Answers answers(renderer);
  reference::Pixels pixels(4, {{2, 2, 0.5f, 0.5f, 7}});
  deep::DeepImage image = reference::makeDeep(pixels, 2);
  image.erase("Z");
  const PicturePtr broken = gui::makePicture("broken.exr", std::move(image));
  renderer.request(requestFor(broken));
  ASSERT_TRUE(QTest::qWaitFor([&] { return !answers.lines.isEmpty(); }));
  EXPECT_TRUE(answers.lines[0].contains("Z")) << answers.lines[0].toStdString();
  EXPECT_TRUE(answers.results.empty());
  renderer.request(requestFor(makePicture(8, 8), 3));
  EXPECT_TRUE(answers.waitFor(3));
}

TEST(Compositor, ClippingChangesPixels) {
  Compositor compositor(display());
  RenderRequest request = requestFor(makePicture(4, 4));
  const QRgb both = compositor.make(request, 1).a.pixel(0, 0);
  EXPECT_GT(qRed(both), 150);
  request.state.clip.near = 3;
  const QRgb behind = compositor.make(request, 1).a.pixel(0, 0);
  EXPECT_LT(qRed(behind), qRed(both));
  EXPECT_GT(qBlue(behind), qRed(behind));
  request.state.clip.inverted = true;
  EXPECT_GT(qRed(compositor.make(request, 1).a.pixel(0, 0)), 150);
}

TEST(Compositor, BrightnessDoesNotCompositeAgain) {
  Compositor compositor(display());
  RenderRequest request = requestFor(makePicture(4, 4));
  const Rendered first = compositor.make(request, 1);
  request.state.display.exposure = -2;
  const Rendered second = compositor.make(request, 1);
  EXPECT_EQ(first.seenA, second.seenA);
  EXPECT_GT(qRed(first.a.pixel(0, 0)), qRed(second.a.pixel(0, 0)));
  EXPECT_EQ(compositor.estimate(request, 1), 0);
  request.state.clip.near = 3;
  EXPECT_GT(compositor.estimate(request, 1), 0);
}

TEST(Compositor, KeepsNoPicture) {
  Compositor compositor(display());
  PicturePtr picture = makePicture(4, 4);
  const std::weak_ptr<const Picture> seen = picture;
  compositor.make(requestFor(picture), 1);
  picture.reset();
  EXPECT_TRUE(seen.expired());
}

TEST(Compositor, AStepTakesEveryOtherPixelAndShrinkingAverages) {
  Compositor compositor(display());
  flat::Image image{{0, 0, 4, 2}, {0, 0, 4, 2}, {}, {}};
  for (const char* name : {"R", "G", "B"}) {
    Buffer<float>& values = image.add(name).values;
    for (size_t i = 0; i < 8; ++i) values[i] = i % 2 ? 1.0f : 0.0f;
  }
  RenderRequest request{gui::makePicture("columns.exr", std::move(image)), nullptr, {}, {0, 0, 4, 2}};
  request.step = 2;
  const Rendered stepped = compositor.make(request, 2);
  EXPECT_EQ(stepped.a.size(), QSize(2, 1));
  EXPECT_EQ(qRed(stepped.a.pixel(1, 0)), 0);
  request.step = 1;
  request.shrink = 2;
  const Rendered shrunk = compositor.make(request, 1);
  EXPECT_EQ(shrunk.a.size(), QSize(2, 1));
  EXPECT_EQ(shrunk.pixelSize, 2);
  EXPECT_EQ(qRed(shrunk.a.pixel(1, 0)), 127);
}

TEST(Compositor, WindowsOfTheTwoMayDiffer) {
  Compositor compositor(display());
  const auto flat = [](const Box& window, float value) {
    flat::Image image{window, {0, 0, 6, 6}, {}, {}};
    for (const char* name : {"R", "G", "B"}) image.add(name, value);
    return gui::makePicture("flat.exr", std::move(image));
  };
  RenderRequest request{flat({0, 0, 3, 3}, 0.5f), flat({2, 2, 5, 5}, 0.5f), {}, {0, 0, 5, 5}};
  request.state.comparison = Comparison::Difference;
  const QImage difference = compositor.make(request, 1).a;
  EXPECT_LT(qGray(difference.pixel(2, 2)), 3);
  EXPECT_GT(qRed(difference.pixel(0, 0)), qBlue(difference.pixel(0, 0)) + 50);  // only A is there
  EXPECT_LT(qRed(difference.pixel(4, 4)), qBlue(difference.pixel(4, 4)) - 50);  // only B
  request.state.comparison = Comparison::RelativeError;
  EXPECT_EQ(compositor.make(request, 1).a.pixel(2, 2), qRgb(0, 0, 0));
}

TEST(Compositor, AWipeIsOneImage) {
  Compositor compositor(display());
  const auto flat = [](float value) {
    flat::Image image{{10, 5, 18, 7}, {0, 0, 20, 20}, {}, {}};
    for (const char* name : {"R", "G", "B"}) image.add(name, value);
    return gui::makePicture("flat.exr", std::move(image));
  };
  RenderRequest request{flat(1), flat(0), {}, {10, 5, 18, 7}};
  request.state.comparison = Comparison::Wipe;
  const QImage wiped = joined(compositor.make(request, 1), 13.2);
  EXPECT_EQ(wiped.size(), QSize(8, 2));
  EXPECT_EQ(qRed(wiped.pixel(2, 1)), 255);
  EXPECT_EQ(qRed(wiped.pixel(3, 1)), 0);
  EXPECT_EQ(qRed(joined(compositor.make(request, 1), 99).pixel(7, 0)), 255);
  EXPECT_EQ(qRed(joined(compositor.make(request, 1), -9).pixel(0, 0)), 0);
  request.state.comparison = Comparison::SideBySide;
  EXPECT_EQ(joined(compositor.make(request, 1), 13).size(), QSize(16, 2));
}

TEST(Compositor, OnlyFalseColoursLookForTheirEnds) {
  Compositor compositor(display());
  RenderRequest request = requestFor(makePicture(64, 48));
  int looks = 0;
  const Progress progress{[&](double done) { looks += done == 0; }, {}};
  compositor.make(request, 1, progress);
  EXPECT_EQ(looks, 1);
  request.state.layer = "Z";
  compositor.make(request, 1, progress);
  EXPECT_EQ(looks, 3);
}

TEST(Compositor, SamplesThatAreNoNumberAreMarkedWhereTheyAreLeft) {
  Compositor compositor(display());
  reference::Pixels pixels(4, {{2, 2, 0.5f, 0.5f, 7}, {5, 5, 1, 0.25f, 9}});
  deep::DeepImage image = reference::makeDeep(pixels, 2);
  image.add("G", deep::PixelType::Float).values.fill(0);
  image.find("R")->values[2] = std::numeric_limits<float>::quiet_NaN();  // the front sample of the second pixel
  RenderRequest request = requestFor(gui::makePicture("poisoned.exr", std::move(image)));
  EXPECT_TRUE(request.a->layer("RGBA")->nonFinite);
  EXPECT_FALSE(request.a->layer("Z")->nonFinite);
  QImage shown = compositor.make(request, 1).a;
  EXPECT_NE(shown.pixel(0, 0), kMarkNan);
  EXPECT_EQ(shown.pixel(1, 0), kMarkNan);
  request.state.clip.near = 3;
  EXPECT_NE(compositor.make(request, 1).a.pixel(1, 0), kMarkNan);
  request.state.clip = {};
  request.state.display.markNan = false;
  EXPECT_NE(compositor.make(request, 1).a.pixel(1, 0), kMarkNan);
}

TEST(Compositor, IdentifiersAreThoseSeenMost) {
  Compositor compositor(display());
  RenderRequest request = requestFor(makePicture(4, 4));
  request.state.layer = "id";
  EXPECT_EQ(compositor.make(request, 1).seenA->ids[0], 7u);
  request.state.clip.near = 3;
  EXPECT_EQ(compositor.make(request, 1).seenA->ids[0], 9u);
  request.state.layer = "samples per pixel";
  EXPECT_EQ(compositor.make(request, 1).seenA->values[0][0], 1);
}

}  // namespace
}  // namespace fathom::gui
