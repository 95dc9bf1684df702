// Jobs one after the other: progress, stopping, replacing, failing.
#include "gui/jobs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <QLabel>
#include <QProgressBar>
#include <QSignalSpy>
#include <QTest>
#include <algorithm>
#include <memory>
#include <numeric>
#include <semaphore>
#include <thread>
#include <vector>

#include "base/error.h"
#include "gui/background.h"
#include "gui/jobs_bar.h"

namespace fathom::gui {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Ne;

bool waitFor(const std::function<bool()>& condition) {
  return QTest::qWaitFor(condition, 20000);
}

// Runs until it is let go or stopped.
Job held(const QString& kind, const QString& name, std::binary_semaphore& gate, std::vector<QString>& done) {
  return {kind, name, [&gate, &done, name](const Progress& progress) {
            progress.at(0.25);
            while (!gate.try_acquire_for(std::chrono::milliseconds(1))) progress.at(0.25);
            return [&done, name] { done.push_back(name); };
          }};
}

Job quick(const QString& kind, const QString& name, std::vector<QString>& done) {
  return {kind, name, [&done, name](const Progress&) { return [&done, name] { done.push_back(name); }; }};
}

TEST(Jobs, RunOneAfterTheOtherAndTheNewestOfAKindReplacesThoseThatWait) {
  std::binary_semaphore gate(0);
  std::vector<QString> done;
  Jobs jobs;
  jobs.add(held("a", "a1", gate, done));
  jobs.add(quick("a", "a2", done));
  jobs.add(quick("b", "b1", done));
  jobs.add(quick("a", "a3", done));
  EXPECT_EQ(jobs.name(), "a1");
  EXPECT_EQ(jobs.waiting(), 2);
  gate.release();
  ASSERT_TRUE(waitFor([&] { return !jobs.busy(); }));
  EXPECT_THAT(done, ElementsAre("a1", "a3", "b1"));
}

TEST(Jobs, CancelStopsTheOneThatRuns) {
  std::binary_semaphore gate(0);
  std::vector<QString> done;
  Jobs jobs;
  QSignalSpy cancelled(&jobs, &Jobs::cancelled);
  jobs.add(held("a", "a", gate, done));
  jobs.add(quick("b", "b", done));
  jobs.cancel();
  ASSERT_TRUE(waitFor([&] { return !jobs.busy(); }));
  EXPECT_EQ(cancelled.count(), 1);
  EXPECT_THAT(done, ElementsAre("b"));
}

TEST(Jobs, AResultThatComesAfterTheStopIsDropped) {
  std::binary_semaphore gate(0), began(0);
  std::vector<QString> done;
  Jobs jobs;
  QSignalSpy cancelled(&jobs, &Jobs::cancelled);
  jobs.add({"a", "a", [&](const Progress&) {
              began.release();
              gate.acquire();  // deaf to the stop
              return [&done] { done.push_back("a"); };
            }});
  began.acquire();
  jobs.cancel();
  gate.release();
  ASSERT_TRUE(waitFor([&] { return cancelled.count() == 1; }));
  EXPECT_TRUE(done.empty());
}

TEST(Jobs, AFailureIsOneLineAndTheNextJobRuns) {
  std::vector<QString> done;
  Jobs jobs;
  QSignalSpy failed(&jobs, &Jobs::failed);
  jobs.add({"a", "a", [](const Progress&) -> std::function<void()> { fail("a.exr: expected\nmore."); }});
  jobs.add(quick("b", "b", done));
  ASSERT_TRUE(waitFor([&] { return !jobs.busy(); }));
  ASSERT_EQ(failed.count(), 1);
  EXPECT_EQ(failed[0][1].toString(), "a.exr: expected more");
  EXPECT_THAT(done, ElementsAre("b"));
}

TEST(JobsBar, ShowsTheProgressAndStops) {
  std::binary_semaphore gate(0);
  std::vector<QString> done;
  Jobs jobs;
  JobsBar bar(jobs);
  EXPECT_TRUE(bar.isHidden());
  jobs.add(held("a", "Denoising", gate, done));
  EXPECT_FALSE(bar.isHidden());
  EXPECT_EQ(bar.findChild<QLabel*>()->text(), "Denoising");
  ASSERT_TRUE(waitFor([&] { return bar.findChild<QProgressBar*>()->value() == 250; }));
  QTest::mouseClick(bar.findChild<QWidget*>("cancelJob"), Qt::LeftButton);
  ASSERT_TRUE(waitFor([&] { return bar.isHidden(); }));
  EXPECT_TRUE(done.empty());
}

TEST(Background, TheNewestReplacesWhatWaits) {
  std::binary_semaphore gate(0);
  std::vector<int> delivered;
  const auto work = [&](int number) {
    return [&, number](const Progress&) {
      if (number == 1) gate.acquire();
      return [&delivered, number] { delivered.push_back(number); };
    };
  };
  Background background;
  for (const int number : {1, 2, 3}) background.run(work(number));
  gate.release();
  ASSERT_TRUE(waitFor([&] { return !background.busy(); }));
  EXPECT_THAT(delivered, ElementsAre(1, 3));
}

TEST(Background, WhatWasClearedIsNotDelivered) {
  std::binary_semaphore gate(0);
  std::vector<int> delivered;
  Background background;
  QSignalSpy failed(&background, &Background::failed);
  background.run([&](const Progress&) -> Background::Deliver {
    gate.acquire();
    fail("stale");
  });
  background.clear();
  background.run([&](const Progress&) { return [&delivered] { delivered.push_back(2); }; });
  gate.release();
  ASSERT_TRUE(waitFor([&] { return !background.busy(); }));
  EXPECT_THAT(delivered, ElementsAre(2));
  EXPECT_EQ(failed.count(), 0);
}

TEST(Caller, CallsInOrderInItsOwnThreadAndNothingOnceItIsGone) {
  std::vector<int> called;
  std::vector<std::thread::id> where;
  auto caller = std::make_unique<Caller>();
  const auto call = [&](int number) {
    caller->call([&, number] {
      called.push_back(number);
      where.push_back(std::this_thread::get_id());
    });
  };
  std::vector<int> expected(1000);
  std::iota(expected.begin(), expected.end(), 0);
  {
    const std::jthread other([&] { std::ranges::for_each(expected, call); });
    ASSERT_TRUE(waitFor([&] { return called.size() == expected.size(); }));  // some are called while others come
  }
  EXPECT_EQ(called, expected);
  EXPECT_THAT(where, Each(std::this_thread::get_id()));
  call(-1);
  caller.reset();
  QTest::qWait(1);
  EXPECT_EQ(called.size(), expected.size());
}

}  // namespace
}  // namespace fathom::gui
