// What is read, in which order, and what stays.
#include "gui/frame_cache.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <QSignalSpy>
#include <QTest>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <semaphore>

#include "base/error.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::gui {
namespace {

using ::testing::ElementsAre;

constexpr size_t kPixels = 1000;

// A flat picture of a little more than 4 * kPixels bytes.
PicturePtr picture(const std::string& path) {
  const Box window{0, 0, int(kPixels), 1};
  flat::Image image{window, window, {}, {}};
  image.add("Y", 1);
  return makePicture(path, std::move(image));
}

// Notes what is read; holds every file until it is let go.
class Disk {
 public:
  FrameCache::Load load() {
    return [this](const std::string& path) {
      if (gated_) gate_.acquire();
      const std::lock_guard lock(mutex_);
      order_.push_back(path);
      if (path.find("bad") != path.npos) fail("{}: expected a picture", path);
      return picture(path);
    };
  }
  void hold() { gated_ = true; }
  void release(int count) { gate_.release(count); }
  std::vector<std::string> order() {
    const std::lock_guard lock(mutex_);
    return order_;
  }

 private:
  bool gated_ = false;
  std::counting_semaphore<> gate_{0};
  std::mutex mutex_;
  std::vector<std::string> order_;
};

bool waitFor(const std::function<bool()>& condition) {
  return QTest::qWaitFor(condition, 20000);
}

TEST(FrameCache, ReadsTheMostUrgentFirst) {
  Disk disk;
  FrameCache cache(nullptr, disk.load());
  cache.want({"2", "3", "1"}, 1);
  ASSERT_TRUE(waitFor([&] { return cache.settled("1"); }));
  EXPECT_THAT(disk.order(), ElementsAre("2", "3", "1"));
}

TEST(FrameCache, WhatIsNotWantedAnyMoreIsNotRead) {
  Disk disk;
  disk.hold();
  FrameCache cache(nullptr, disk.load());
  cache.want({"1", "2", "3"}, 1);
  cache.want({"7", "8"}, 1);  // 1 is being read
  disk.release(3);
  ASSERT_TRUE(waitFor([&] { return cache.settled("8"); }));
  EXPECT_THAT(disk.order(), ElementsAre("1", "7", "8"));
}

TEST(FrameCache, TheLeastRecentlyUsedGoesFirst) {
  Disk disk;
  FrameCache cache(nullptr, disk.load());
  cache.setLimit(3 * picture("")->bytes());
  for (const char* path : {"1", "2", "3", "1", "4"}) {
    cache.want({path}, 1);
    ASSERT_TRUE(waitFor([&] { return cache.settled(path); }));
  }
  EXPECT_TRUE(cache.find("1"));
  EXPECT_FALSE(cache.find("2"));
  EXPECT_TRUE(cache.find("3"));
  EXPECT_LE(cache.bytes(), cache.limit());
}

TEST(FrameCache, TheOneShownStaysEvenWhereItIsTooLarge) {
  Disk disk;
  FrameCache cache(nullptr, disk.load());
  cache.setLimit(10);
  cache.want({"1", "2"}, 1);
  ASSERT_TRUE(waitFor([&] { return cache.settled("1"); }));
  EXPECT_TRUE(cache.find("1"));
  cache.want({"2"}, 1);
  ASSERT_TRUE(waitFor([&] { return cache.settled("2"); }));
  EXPECT_FALSE(cache.find("1"));
  EXPECT_THAT(disk.order(), ElementsAre("1", "2"));
}

TEST(FrameCache, ReadsAheadAsFarAsThereIsRoom) {
  Disk disk;
  FrameCache cache(nullptr, disk.load());
  cache.setLimit(3 * picture("")->bytes());
  cache.want({"1", "2", "3", "4", "5"}, 1);
  ASSERT_TRUE(waitFor([&] { return cache.settled("3"); }));
  cache.want({"2", "3", "4", "5", "1"}, 1);
  ASSERT_TRUE(waitFor([&] { return cache.settled("4"); }));
  EXPECT_FALSE(cache.find("1"));  // wanted, but last of all
  cache.want({"9"}, 1);
  ASSERT_TRUE(waitFor([&] { return cache.settled("9"); }));
  EXPECT_THAT(disk.order(), ElementsAre("1", "2", "3", "4", "9"));
}

TEST(FrameCache, AFailureIsToldOnceAndStopsNothing) {
  Disk disk;
  FrameCache cache(nullptr, disk.load());
  QSignalSpy spy(&cache, &FrameCache::failed);
  cache.want({"1", "bad", "3"}, 1);
  ASSERT_TRUE(waitFor([&] { return cache.settled("3"); }));
  cache.want({"bad", "3"}, 1);
  cache.want({"4"}, 1);
  ASSERT_TRUE(waitFor([&] { return cache.settled("4"); }));
  EXPECT_EQ(spy.count(), 1);
  EXPECT_EQ(cache.failure("bad"), "bad: expected a picture");
}

// Reads a file's whole text as the number of pixels.
PicturePtr countedPicture(const std::string& path) {
  std::ifstream file(path);
  int pixels = 0;
  if (!(file >> pixels)) fail("{}: expected a number", path);
  const Box window{0, 0, pixels, 1};
  flat::Image image{window, window, {}, {}};
  image.add("Y", 1);
  return makePicture(path, std::move(image));
}

void write(const std::string& path, const std::string& text) {
  std::ofstream(path) << text;
}

int widthOf(const FrameCache& cache, const std::string& path) {
  const PicturePtr found = cache.find(path);
  return found ? found->dataWindow().width() : -1;
}

TEST(FrameCache, AChangedFileIsReadAgain) {
  const TemporaryFolder folder;
  const std::string shown = folder / "1", other = folder / "2";
  write(shown, "5");
  write(other, "6");
  FrameCache cache(nullptr, countedPicture);
  cache.want({shown, other}, 1);
  ASSERT_TRUE(waitFor([&] { return cache.settled(other); }));
  write(shown, "50");  // in place
  ASSERT_TRUE(waitFor([&] { return widthOf(cache, shown) == 50; }));
  write(folder / "new", "500");  // replaced
  std::filesystem::rename(folder / "new", shown);
  ASSERT_TRUE(waitFor([&] { return widthOf(cache, shown) == 500; }));
  write(folder / "new", "60");
  std::filesystem::rename(folder / "new", other);  // not on the screen
  ASSERT_TRUE(waitFor([&] { return widthOf(cache, other) == 60; }));
}

TEST(FrameCache, AFileCaughtHalfWrittenIsTriedAgain) {
  const TemporaryFolder folder;
  const std::string path = folder / "1";
  write(path, "");
  int tries = 0;
  FrameCache cache(nullptr, [&](const std::string& name) {
    if (++tries == 1) fail("{}: expected more", name);
    return countedPicture(name);
  });
  write(path, "5");
  QSignalSpy spy(&cache, &FrameCache::failed);
  cache.want({path}, 1);
  ASSERT_TRUE(waitFor([&] { return widthOf(cache, path) == 5; }));
  EXPECT_EQ(spy.count(), 0);
}

TEST(FrameCache, AFileThatIsSpoiltKeepsItsLastPictureAndIsTold) {
  const TemporaryFolder folder;
  const std::string path = folder / "1";
  write(path, "5");
  FrameCache cache(nullptr, countedPicture);
  QSignalSpy spy(&cache, &FrameCache::failed);
  cache.want({path}, 1);
  ASSERT_TRUE(waitFor([&] { return widthOf(cache, path) == 5; }));
  write(path, "no number");
  ASSERT_TRUE(waitFor([&] { return spy.count() == 1; }));
  EXPECT_EQ(widthOf(cache, path), 5);
  std::filesystem::remove(path);
  write(path, "7");
  ASSERT_TRUE(waitFor([&] { return widthOf(cache, path) == 7; }));
}

// As the watcher does not hear of another machine's changes, nor of a link that leads elsewhere.
TEST(FrameCache, ChangesThatAreNotToldAreFound) {
  const TemporaryFolder folder;
  for (const char* version : {"v1", "v2"}) std::filesystem::create_directory(folder / version);
  write(folder / "v1/1", "5");
  write(folder / "v2/1", "50");
  std::filesystem::create_directory_symlink("v1", folder / "latest");
  const std::string path = folder / "latest/1";
  FrameCache cache(nullptr, countedPicture);
  cache.want({path}, 1);
  ASSERT_TRUE(waitFor([&] { return widthOf(cache, path) == 5; }));
  std::filesystem::remove(folder / "latest");
  std::filesystem::create_directory_symlink("v2", folder / "latest");
  EXPECT_TRUE(waitFor([&] { return widthOf(cache, path) == 50; }));
}

TEST(FrameCache, AFileThatAlwaysChangesIsLookedAt) {
  const TemporaryFolder folder;
  const std::string path = folder / "1";
  write(path, "5");
  FrameCache cache(nullptr, countedPicture);
  cache.want({path}, 1);
  ASSERT_TRUE(waitFor([&] { return widthOf(cache, path) == 5; }));
  QTimer writer;
  int pixels = 5;
  QObject::connect(&writer, &QTimer::timeout, [&] { write(path, std::to_string(++pixels)); });
  writer.start(50);
  EXPECT_TRUE(QTest::qWaitFor([&] { return widthOf(cache, path) > 5; }, 20000));
}

TEST(FrameCache, WhatIsShownIsReadAgainWhenAsked) {
  Disk disk;
  FrameCache cache(nullptr, disk.load());
  cache.want({"1", "2"}, 1);
  ASSERT_TRUE(waitFor([&] { return cache.settled("2"); }));
  cache.reload();
  ASSERT_TRUE(waitFor([&] { return disk.order().size() == 3; }));
  EXPECT_THAT(disk.order(), ElementsAre("1", "2", "1"));
}

TEST(FrameCache, NoFileIsReadThatNeedsMoreThanTheLimit) {
  FrameCache cache;
  cache.setLimit(1000);
  cache.want({FATHOM_DEMO "/smoke.0001.deep.exr"}, 1);
  ASSERT_TRUE(waitFor([&] { return cache.settled(FATHOM_DEMO "/smoke.0001.deep.exr"); }));
  EXPECT_FALSE(cache.find(FATHOM_DEMO "/smoke.0001.deep.exr"));
}

TEST(FrameCache, AFileThatComesLaterIsRead) {
  const TemporaryFolder folder;
  const std::string path = folder / "1";
  FrameCache cache(nullptr, countedPicture);
  QSignalSpy spy(&cache, &FrameCache::failed);
  cache.want({path}, 1);
  ASSERT_TRUE(waitFor([&] { return spy.count() == 1; }));
  write(path, "7");
  ASSERT_TRUE(waitFor([&] { return widthOf(cache, path) == 7; }));
}

}  // namespace
}  // namespace fathom::gui
