// Files and sequences as A and B, and the bar that plays them.
#include "gui/frames.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <QSignalSpy>
#include <QTest>
#include <atomic>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "flat/io.h"
#include "gui/playback_bar.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::gui {
namespace {

using ::testing::ElementsAre;

bool waitFor(const std::function<bool()>& condition) {
  return QTest::qWaitFor(condition, 20000);
}

void writeFrame(const std::string& path) {
  const Box window{0, 0, 4, 3};
  flat::Image image{window, window, {}, {}};
  for (const char* name : {"R", "G", "B"}) image.add(name, 0.5f);
  flat::write(path, image);
}

class FramesTest : public ::testing::Test {
 protected:
  FramesTest() : frames_(session_) {
    for (const char* name : {"a.0001.exr", "a.0002.exr", "a.0004.exr", "b.0002.exr", "b.0004.exr", "plain.exr"})
      writeFrame(folder_ / name);
    QObject::connect(&session_, &Session::said, [this](const QString& line) { said_ = line; });
  }

  QString path(const char* name) { return QString::fromStdString(folder_ / name); }
  // Cuts a file short, long ago.
  void spoil(const char* name) {
    std::filesystem::resize_file(folder_ / name, 50);
    std::filesystem::last_write_time(folder_ / name,
                                     std::filesystem::file_time_type::clock::now() - std::chrono::hours(1));
  }
  // What stands in the session's A, or B, without its folder.
  static std::string nameOf(const PicturePtr& picture) {
    return picture ? std::filesystem::path(picture->path).filename().string() : "";
  }
  bool shows(const std::string& a, const std::string& b = "") {
    return waitFor([&] { return nameOf(session_.a()) == a && nameOf(session_.b()) == b; });
  }

  TemporaryFolder folder_;
  Session session_;
  Frames frames_;
  QString said_;
};

TEST(FindNumber, TheLastNumberBeforeADot) {
  EXPECT_EQ(cli::findNumber("x/beauty.0042.exr")->pattern.text(), "x/beauty.####.exr");
  EXPECT_EQ(cli::findNumber("beauty.0042.deep.exr")->frame, 42);
  EXPECT_EQ(cli::findNumber("v2.shot_007.exr")->pattern.text(), "v2.shot_###.exr");
  EXPECT_EQ(cli::findNumber("0007.exr")->frame, 7);
  EXPECT_FALSE(cli::findNumber("shots.1/staircase2.deep.exr"));
  EXPECT_FALSE(cli::findNumber("plain.exr"));
  EXPECT_FALSE(cli::findNumber("99999999999.exr"));
}

TEST(FindNumber, UnpaddedNumbersBelongTogether) {
  const TemporaryFolder folder;
  for (const char* name : {"a.8.exr", "a.9.exr", "a.10.exr"}) writeFrame(folder / name);
  const auto found = cli::findNumber(folder / "a.10.exr");
  EXPECT_THAT(cli::framesOnDisk(found->pattern), ElementsAre(8, 9, 10));
}

TEST_F(FramesTest, AFileOfASequenceIsOpenedWithItsNeighbours) {
  frames_.open(path("a.0002.exr"));
  ASSERT_TRUE(shows("a.0002.exr"));
  EXPECT_THAT(frames_.player().frames(), ElementsAre(1, 2, 4));
  frames_.player().next();
  EXPECT_TRUE(shows("a.0004.exr"));
  ASSERT_TRUE(waitFor([&] { return frames_.cached(1) && frames_.cached(2); }));
}

TEST_F(FramesTest, APatternBeginsWithItsFirstFrame) {
  frames_.open(path("b.%04d.exr"));
  EXPECT_TRUE(shows("b.0002.exr"));
  EXPECT_THAT(frames_.player().frames(), ElementsAre(2, 4));
}

TEST_F(FramesTest, BFollowsWithTheSameNumberAndIsEmptyWhereItHasNone) {
  frames_.open(path("a.0002.exr"));
  frames_.openB(path("b.0004.exr"));
  ASSERT_TRUE(shows("a.0002.exr", "b.0002.exr"));
  frames_.player().next();
  ASSERT_TRUE(shows("a.0004.exr", "b.0004.exr"));
  frames_.player().next();
  EXPECT_TRUE(shows("a.0001.exr", ""));
  frames_.swap();
  frames_.player().setFrame(4);
  EXPECT_TRUE(shows("b.0004.exr", "a.0004.exr"));
  frames_.closeB();
  EXPECT_TRUE(shows("b.0004.exr", ""));
}

TEST_F(FramesTest, APlainBStaysForAllFrames) {
  frames_.open(path("a.####.exr"));
  frames_.openB(path("plain.exr"));
  ASSERT_TRUE(shows("a.0001.exr", "plain.exr"));
  frames_.player().next();
  EXPECT_TRUE(shows("a.0002.exr", "plain.exr"));
}

TEST_F(FramesTest, AFileThatCannotBeReadIsSaidAndTheLastPictureStays) {
  frames_.open(path("a.0002.exr"));
  ASSERT_TRUE(shows("a.0002.exr"));
  std::filesystem::copy_file(folder_ / "a.0001.exr", folder_ / "broken.exr");
  spoil("broken.exr");
  frames_.open(path("broken.exr"));
  ASSERT_TRUE(waitFor([&] { return said_.contains("broken.exr"); }));
  EXPECT_EQ(nameOf(session_.a()), "a.0002.exr");
  EXPECT_THAT(frames_.player().frames(), ElementsAre(1, 2, 4));
  frames_.open(path("nothing.####.exr"));
  EXPECT_TRUE(said_.contains("nothing.####.exr"));
  frames_.player().next();
  EXPECT_TRUE(shows("a.0004.exr"));
}

TEST_F(FramesTest, AResultComesAsBAndStaysWithItsFrame) {
  frames_.open(path("a.0002.exr"));
  ASSERT_TRUE(shows("a.0002.exr"));
  const Box window{0, 0, 4, 3};
  frames_.setResult(folder_ / "a.0002.exr", "denoised", makePicture("result", flat::Image{window, window, {}, {}}));
  EXPECT_EQ(nameOf(session_.b()), "result");
  frames_.player().next();
  EXPECT_TRUE(shows("a.0004.exr", ""));
  frames_.player().previous();
  EXPECT_TRUE(shows("a.0002.exr", "result"));
  // Of a file that is not open any more.
  frames_.open(path("plain.exr"));
  ASSERT_TRUE(shows("plain.exr", ""));
  frames_.setResult(folder_ / "a.0002.exr", "denoised", session_.a());
  EXPECT_EQ(session_.b(), nullptr);
}

TEST_F(FramesTest, AResultStaysWhereTheMemoryIsFull) {
  Frames frames(session_, nullptr, [](const std::string& name) { return loadPicture(name); });
  frames.open(path("a.0001.exr"));
  ASSERT_TRUE(waitFor([&] { return frames.cached(1) && frames.cached(2) && frames.cached(4); }));
  frames.cache().setLimit(frames.cache().bytes() * 5 / 6);
  ASSERT_TRUE(frames.cached(2));
  const auto result = [&](int frame) {
    const Box window{0, 0, 4, 3};
    const std::string name = "result" + std::to_string(frame);
    frames.setResult(frames.a()->at(frame), "denoised", makePicture(name, flat::Image{window, window, {}, {}}));
  };
  result(1);
  EXPECT_EQ(nameOf(session_.b()), "result1");
  frames.player().next();
  ASSERT_TRUE(shows("a.0002.exr"));
  result(2);
  EXPECT_EQ(nameOf(session_.b()), "result2");
  frames.player().previous();
  EXPECT_TRUE(shows("a.0001.exr", "result1"));
  const QSignalSpy loaded(&frames.cache(), &FrameCache::loaded);
  QTest::qWait(200);
  EXPECT_LE(loaded.count(), 1);  // there is no room for more
  const std::string made = frames.b()->at(1);
  frames.closeB();
  EXPECT_FALSE(frames.cache().find(made));
}

TEST_F(FramesTest, AResultStaysWhereTheNextFileCannotBeRead) {
  frames_.open(path("a.0002.exr"));
  ASSERT_TRUE(shows("a.0002.exr"));
  const Box window{0, 0, 4, 3};
  frames_.setResult(folder_ / "a.0002.exr", "denoised", makePicture("result", flat::Image{window, window, {}, {}}));
  frames_.open(path("nothing.exr"));
  ASSERT_TRUE(waitFor([&] { return said_.contains("nothing.exr"); }));
  EXPECT_TRUE(frames_.b());
  EXPECT_TRUE(shows("a.0002.exr", "result"));
}

TEST_F(FramesTest, FramesThatDoNotBelongTogetherAreNeverSeen) {
  frames_.open(path("a.0002.exr"));
  frames_.openB(path("b.0002.exr"));
  ASSERT_TRUE(shows("a.0002.exr", "b.0002.exr"));
  std::vector<std::string> seen;
  QObject::connect(&session_, &Session::picturesChanged,
                   [&] { seen.push_back(nameOf(session_.a()) + " " + nameOf(session_.b())); });
  frames_.player().next();
  ASSERT_TRUE(shows("a.0004.exr", "b.0004.exr"));
  EXPECT_THAT(seen, ElementsAre("a.0004.exr b.0004.exr"));
}

TEST_F(FramesTest, BWaitsWithAnAThatCannotBeRead) {
  spoil("a.0004.exr");
  frames_.open(path("a.0002.exr"));
  frames_.openB(path("b.0002.exr"));
  ASSERT_TRUE(shows("a.0002.exr", "b.0002.exr"));
  frames_.player().next();
  ASSERT_TRUE(waitFor([&] { return frames_.ready(4); }));
  EXPECT_EQ(nameOf(session_.a()), "a.0002.exr");
  EXPECT_EQ(nameOf(session_.b()), "b.0002.exr");
  frames_.closeB();
  EXPECT_TRUE(shows("a.0002.exr", ""));
}

TEST_F(FramesTest, TheFramesAreThoseOfTheSourceThatLeads) {
  frames_.open(path("b.####.exr"));
  frames_.openB(path("a.####.exr"));
  frames_.swap();
  EXPECT_THAT(frames_.player().frames(), ElementsAre(1, 2, 4));
  frames_.open(path("plain.exr"));
  frames_.openB(path("b.####.exr"));
  EXPECT_THAT(frames_.player().frames(), ElementsAre(2, 4));
  frames_.closeB();
  EXPECT_THAT(frames_.player().frames(), ElementsAre(0));
  EXPECT_TRUE(shows("plain.exr", ""));
}

TEST_F(FramesTest, OfALongSequenceOnlyWhatComesSoonIsReadAhead) {
  for (int frame = 0; frame < 300; ++frame) std::ofstream(folder_ / fmt::format("long.{:03}.exr", frame));
  std::atomic<int> reads = 0;
  Frames frames(session_, nullptr, [&](const std::string& path) {
    ++reads;
    const Box window{0, 0, 1, 1};
    return makePicture(path, flat::Image{window, window, {}, {}});
  });
  frames.open(path("long.###.exr"));
  ASSERT_TRUE(waitFor([&] { return reads >= 257; }));
  QTest::qWait(50);
  EXPECT_EQ(reads, 257);
}

TEST_F(FramesTest, FilesOfOneSequenceAreOneSource) {
  EXPECT_EQ(distinctSources({path("a.0002.exr"), path("a.0001.exr"), path("plain.exr"), path("b.####.exr"),
                             path("b.0002.exr"), path("nothing.exr"), path("nothing.####.exr")}),
            QStringList({path("a.0002.exr"), path("plain.exr"), path("b.####.exr"), path("nothing.exr"),
                         path("nothing.####.exr")}));
}

TEST_F(FramesTest, ReloadingFindsNewFrames) {
  frames_.open(path("b.0002.exr"));
  ASSERT_TRUE(shows("b.0002.exr"));
  const PicturePtr before = session_.a();
  writeFrame(folder_ / "b.0003.exr");
  frames_.reload();
  EXPECT_THAT(frames_.player().frames(), ElementsAre(2, 3, 4));
  EXPECT_TRUE(waitFor([&] { return session_.a() != before; }));
  EXPECT_EQ(nameOf(session_.a()), "b.0002.exr");
}

TEST_F(FramesTest, AStageStandsBetweenTheFilesAndTheScreen) {
  frames_.open(path("a.0002.exr"));
  ASSERT_TRUE(shows("a.0002.exr"));
  std::vector<std::string> staged;
  frames_.setStage([&](const PicturePtr& a, const PicturePtr&) { staged.push_back(nameOf(a)); }, [] { return false; });
  frames_.player().next();
  ASSERT_TRUE(waitFor([&] { return staged.size() == 2; }));
  EXPECT_THAT(staged, ElementsAre("a.0002.exr", "a.0004.exr"));
  EXPECT_EQ(nameOf(session_.a()), "a.0002.exr");
  frames_.setStage({}, {});
  EXPECT_EQ(nameOf(session_.a()), "a.0004.exr");
}

QAction* actionOf(const PlaybackBar& bar, const QString& text) {
  for (QAction* action : bar.actions())
    if (action->text() == text) return action;
  return nullptr;
}

TEST_F(FramesTest, TheBarShowsAndChangesTheFrame) {
  frames_.open(path("a.0001.exr"));
  PlaybackBar bar(frames_);
  bar.resize(900, 40);
  bar.show();
  ASSERT_TRUE(shows("a.0001.exr"));
  auto* slider = bar.findChild<TimeSlider*>();
  const auto at = [&](int frame) { return QPoint(int(slider->xOf(frame)), slider->height() / 2); };
  QTest::mousePress(slider, Qt::LeftButton, {}, at(2));
  EXPECT_EQ(frames_.player().frame(), 2);
  QTest::mouseMove(slider, at(4));
  EXPECT_EQ(frames_.player().frame(), 4);
  QTest::mouseRelease(slider, Qt::LeftButton, {}, at(4));
  auto* number = bar.findChild<QSpinBox*>("frame");
  EXPECT_EQ(number->value(), 4);
  number->selectAll();
  QTest::keyClicks(number, "1");
  QTest::keyClick(number, Qt::Key_Return);
  EXPECT_EQ(frames_.player().frame(), 1);
  EXPECT_TRUE(shows("a.0001.exr"));
  actionOf(bar, "Next frame")->trigger();
  actionOf(bar, "Play from here")->trigger();
  EXPECT_EQ(frames_.player().in(), 2);
  EXPECT_TRUE(actionOf(bar, "Play all frames")->isEnabled());
  actionOf(bar, "Play all frames")->trigger();
  EXPECT_EQ(frames_.player().in(), 1);
  actionOf(bar, "Play")->trigger();
  EXPECT_TRUE(frames_.player().playing());
  ASSERT_TRUE(waitFor([&] { return frames_.player().frame() == 1; }));  // around its end
}

TEST_F(FramesTest, APlainFileIsNotPlayed) {
  PlaybackBar bar(frames_);
  frames_.open(path("plain.exr"));
  ASSERT_TRUE(shows("plain.exr"));
  EXPECT_FALSE(actionOf(bar, "Play")->isEnabled());
}

}  // namespace
}  // namespace fathom::gui
