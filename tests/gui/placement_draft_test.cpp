// While a volume moves the screen shows a draft that is what the whole will be.
#include <gtest/gtest.h>

#include <QTest>

#include "deep/io.h"
#include "deep/ops/insert.h"
#include "gui/canvas.h"
#include "gui/placement.h"
#include "tests/reference/random_deep.h"
#include "tests/reference/rendered_frame.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::gui {
namespace {

bool waitFor(const std::function<bool()>& condition) {
  return QTest::qWaitFor(condition, 60000);
}

class DraftTest : public ::testing::Test {
 protected:
  DraftTest() : frames_(session_), placement_(session_, frames_) {
    reference::RenderedFrame frame = reference::renderFrame();
    deep::write(folder_ / "noisy.exr", frame.noisy);
    deep::write(folder_ / "smoke.exr", reference::renderFrame({.seed = 2, .volumes = true}).truth);
    frames_.open(path("noisy.exr"));
    placement_.open(path("smoke.exr"));
    EXPECT_TRUE(waitFor([&] { return session_.a() && !placement_.busy(); }));
  }
  QString path(const char* name) { return QString::fromStdString(folder_ / name); }
  void seeLayer(const std::string& name) {
    ViewState view = session_.view();
    view.layer = name;
    session_.setView(view);
  }

  TemporaryFolder folder_;
  Session session_;
  Frames frames_;
  Placement placement_;
};

void expectEqual(const Seen& a, const Seen& b) {
  ASSERT_EQ(a.values.size(), b.values.size());
  for (size_t c = 0; c < a.values.size(); ++c)
    EXPECT_TRUE(std::ranges::equal(a.values[c], b.values[c])) << a.layer.name;
  EXPECT_TRUE(std::ranges::equal(a.alpha, b.alpha)) << a.layer.name;
  EXPECT_TRUE(std::ranges::equal(a.ids, b.ids)) << a.layer.name;
}

TEST_F(DraftTest, ShowsWhatTheWholeIs) {
  const Box box = session_.a()->dataWindow();
  for (const deep::Transform& transform :
       {deep::Transform{.x = 5, .y = -3, .z = 1, .zScale = 0.5}, deep::Transform{.x = 2.5, .scale = 0.8, .z = -0.5}})
    for (const char* layer : {"RGBA", "Z", "samples per pixel"}) {
      seeLayer(layer);
      placement_.setTransform(transform);
      ASSERT_TRUE(waitFor([&] { return session_.draft().has_value(); }));
      const Draft draft = *session_.draft();
      EXPECT_EQ(draft.a, frames_.originalA());
      ASSERT_TRUE(waitFor([&] { return !placement_.busy(); }));
      EXPECT_FALSE(session_.draft());
      for (const int step : {1, 3}) {
        const deep::DepthRange clip{4, 9};
        expectEqual(see(*draft.a, layer, clip, box, step, {}, draft.overlay.get()),
                    see(*session_.a(), layer, clip, box, step));
      }
      placement_.setTransform({});
      ASSERT_TRUE(waitFor([&] { return !placement_.busy(); }));
    }
}

TEST_F(DraftTest, IsOnTheScreenWhileAllElseKeepsTheLastRest) {
  Canvas canvas(session_, std::make_shared<const Display>());
  canvas.resize(300, 200);
  canvas.show();
  ASSERT_TRUE(waitFor([&] { return canvas.isCurrent(); }));
  const PicturePtr rest = session_.a();
  const QImage before = canvas.shown().a;
  int pictures = 0;
  QObject::connect(&session_, &Session::picturesChanged, &canvas, [&] { ++pictures; });
  placement_.setTransform({.x = 7, .z = -2});
  ASSERT_TRUE(waitFor([&] { return session_.draft() && canvas.isCurrent(); }));
  EXPECT_EQ(session_.a(), rest);
  EXPECT_EQ(pictures, 0);
  const QImage draft = canvas.shown().a;
  EXPECT_NE(draft, before);
  ASSERT_TRUE(waitFor([&] { return !placement_.busy() && canvas.isCurrent(); }));
  EXPECT_EQ(pictures, 1);
  EXPECT_EQ(canvas.shown().a, draft);
}

TEST_F(DraftTest, OfAnotherLayerThereIsNone) {
  placement_.setTransform({.z = 1});
  Canvas canvas(session_, std::make_shared<const Display>());
  canvas.resize(300, 200);
  canvas.show();
  QString said;
  QObject::connect(&session_, &Session::said, &canvas, [&](const QString& line) { said = line; });
  ASSERT_TRUE(waitFor([&] { return session_.draft().has_value(); }));
  seeLayer("diffuse");
  ASSERT_TRUE(waitFor([&] { return canvas.isCurrent(); }));
  EXPECT_EQ(canvas.shown().request.overlay, nullptr);
  ASSERT_TRUE(waitFor([&] { return !placement_.busy() && canvas.isCurrent(); }));
  EXPECT_EQ(said, "");
}

TEST_F(DraftTest, OfManyMovesTheLastOneStays) {
  for (int i = 1; i <= 20; ++i) {
    placement_.setTransform({.z = double(i)});
    QTest::qWait(i % 7);
  }
  EXPECT_TRUE(placement_.busy());
  ASSERT_TRUE(waitFor([&] { return !placement_.busy(); }));
  const deep::DeepImage expected =
      deep::insert(*frames_.originalA()->deep(), deep::read(folder_ / "smoke.exr"), {.z = 20});
  EXPECT_EQ(reference::difference(*session_.a()->deep(), expected), "");
}

}  // namespace
}  // namespace fathom::gui
