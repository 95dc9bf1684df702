// Denoising and saving what is open: the same bits as the command line, and what cannot be done is said.
#include "gui/frame_jobs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <QTest>
#include <filesystem>

#include "base/error.h"
#include "cli/denoise_job.h"
#include "deep/clip.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"
#include "tests/reference/random_deep.h"
#include "tests/reference/rendered_frame.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::gui {
namespace {

bool waitFor(const std::function<bool()>& condition) {
  return QTest::qWaitFor(condition, 60000);
}

class FrameJobsTest : public ::testing::Test {
 protected:
  FrameJobsTest() : frames_(session_), frameJobs_(session_, frames_, jobs_) {
    QObject::connect(&session_, &Session::said, [this](const QString& line) { said_ = line; });
    for (unsigned frame = 1; frame <= 3; ++frame)
      deep::write(file("noisy", int(frame)), reference::renderFrame({.seed = frame, .volumes = true}).noisy);
  }
  std::string file(const std::string& name, int frame) { return folder_ / fmt::format("{}.{}.exr", name, frame); }
  QString path(const std::string& name) { return QString::fromStdString(folder_ / name); }
  void open(const std::string& name) {
    frames_.open(path(name));
    ASSERT_TRUE(waitFor([&] { return session_.a() && session_.a()->path == folder_ / name; }));
  }
  void finish() {
    ASSERT_TRUE(waitFor([&] { return !jobs_.busy(); }));
  }
  void setClip(const deep::DepthRange& range) {
    ViewState view = session_.view();
    view.clip = range;
    session_.setView(view);
  }

  TemporaryFolder folder_;
  Session session_;
  Frames frames_;
  Jobs jobs_;
  FrameJobs frameJobs_;
  QString said_;
};

TEST_F(FrameJobsTest, AFrameAloneIsWhatTheSequenceHasThere) {
  open("noisy.2.exr");
  frameJobs_.denoiseFrame(deep::Quality::Fast);
  finish();
  ASSERT_TRUE(session_.b());
  EXPECT_TRUE(said_.contains("denoised"));
  const PicturePtr alone = session_.b();
  EXPECT_NE(reference::difference(*alone->deep(), *session_.a()->deep()), "");
  frames_.player().setIn(2);
  frameJobs_.denoiseSequence(path("clean.#.exr"), deep::Quality::Fast);
  finish();
  EXPECT_FALSE(std::filesystem::exists(file("clean", 1)));
  EXPECT_TRUE(std::filesystem::exists(file("clean", 3)));
  EXPECT_EQ(reference::difference(*alone->deep(), deep::read(file("clean", 2))), "");
  EXPECT_TRUE(said_.startsWith("2 of 2"));
  ASSERT_TRUE(waitFor([&] { return session_.b() && session_.b()->path == file("clean", 2); }));
  frames_.player().clearRange();
  frameJobs_.denoiseSequence(path("clean.#.exr"), deep::Quality::Fast);
  finish();
  EXPECT_EQ(said_, "1 of 3 frames denoised, 2 were done before");
}

TEST_F(FrameJobsTest, AJobThatIsStoppedLeavesBAsItIs) {
  open("noisy.1.exr");
  frameJobs_.denoiseFrame();
  jobs_.cancel();
  finish();
  EXPECT_FALSE(session_.b());
  EXPECT_TRUE(said_.contains("stopped"));
}

TEST_F(FrameJobsTest, WhatCannotBeDenoisedIsSaid) {
  frameJobs_.denoiseFrame();
  EXPECT_TRUE(said_.contains("Open"));
  deep::DeepImage image = reference::renderFrame().noisy;
  image.erase("G");
  deep::write(folder_ / "poor.exr", image);
  open("poor.exr");
  frameJobs_.denoiseFrame();
  finish();
  EXPECT_TRUE(said_.contains("channel G"));
  frameJobs_.denoiseSequence(path("clean.jpg"));
  finish();
  EXPECT_TRUE(said_.startsWith("expected a name that ends in .exr")) << said_.toStdString();
  frameJobs_.denoiseSequence(path("missing/clean.exr"));
  finish();
  EXPECT_TRUE(said_.contains("missing/clean.exr"));
}

// Whatever is played, and whatever stands in its name.
TEST_F(FrameJobsTest, APlainFileIsDenoisedToAFile) {
  std::filesystem::copy_file(file("noisy", 1), folder_ / "plain#.exr");
  open("plain#.exr");
  frames_.openB(path("noisy.#.exr"));
  frames_.player().setIn(2);
  frameJobs_.denoiseSequence(path("clean.exr"), deep::Quality::Fast);
  finish();
  EXPECT_EQ(said_, "1 of 1 frames denoised");
  ASSERT_TRUE(waitFor([&] { return session_.b() && session_.b()->path == folder_ / "clean.exr"; }));
  EXPECT_THROW(cli::makeDenoiseJob({}, {}, false), Error);
}

TEST_F(FrameJobsTest, SavesWhatTheRangeLeaves) {
  open("noisy.1.exr");
  setClip({.near = 5.3f, .far = 9.8f});
  frameJobs_.saveFlattened(path("flat.exr"));
  frameJobs_.saveDeep(path("deep.exr"));
  finish();
  const deep::DeepImage clipped = deep::clip(*session_.a()->deep(), 5.3f, 9.8f);
  EXPECT_EQ(reference::difference(deep::read(folder_ / "deep.exr"), clipped), "");
  const flat::Image saved = flat::read(folder_ / "flat.exr"), expected = deep::flatten(clipped);
  for (const flat::Plane& plane : expected.planes)
    EXPECT_TRUE(std::ranges::equal(saved.get(plane.name).values, plane.values)) << plane.name;
}

TEST_F(FrameJobsTest, ASoftRangeIsFlattenedWithAllPlanesAndNotSavedDeep) {
  open("noisy.1.exr");
  setClip({.near = 5.3f, .soft = 2});
  frameJobs_.saveFlattened(path("flat.exr"));
  finish();
  const flat::Image saved = flat::read(folder_ / "flat.exr"), hard = deep::flatten(*session_.a()->deep());
  EXPECT_EQ(saved.dataWindow, hard.dataWindow);
  EXPECT_EQ(saved.planes.size(), hard.planes.size());
  frameJobs_.saveDeep(path("deep.exr"));
  finish();
  EXPECT_TRUE(said_.contains("soft"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "deep.exr"));
}

TEST_F(FrameJobsTest, WhatIsOpenIsNotWrittenOver) {
  open("noisy.1.exr");
  frameJobs_.saveFlattened(path("noisy.1.exr"));
  finish();
  EXPECT_TRUE(said_.contains("another file"));
  EXPECT_NO_THROW(deep::read(file("noisy", 1)));
}

TEST_F(FrameJobsTest, SavesAPicture) {
  QImage image(4, 3, QImage::Format_RGB888);
  image.fill(Qt::red);
  frameJobs_.savePng(path("a.png"), [image] { return image; });
  finish();
  EXPECT_EQ(QImage(path("a.png")).pixelColor(1, 1), QColor(Qt::red));
  frameJobs_.savePng(path("missing/a.png"), [image] { return image; });
  finish();
  EXPECT_TRUE(said_.contains("missing/a.png"));
  frameJobs_.savePng(path("empty.png"), [] { return QImage(); });
  finish();
  EXPECT_TRUE(said_.contains("empty data window")) << said_.toStdString();
  EXPECT_FALSE(std::filesystem::exists(folder_ / "empty.png"));
}

}  // namespace
}  // namespace fathom::gui
