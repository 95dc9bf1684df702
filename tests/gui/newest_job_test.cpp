// Of the jobs that wait the newest alone is done, and what was forgotten is not delivered.
#include "gui/newest_job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <QSignalSpy>
#include <QTest>
#include <latch>

#include "flat/error.h"

namespace fathom::gui {
namespace {

using ::testing::ElementsAre;

// Jobs that tell their number when they are delivered; the first holds the thread until it is let go.
struct Jobs {
  std::latch begun{1}, go{1};
  std::vector<int> done, delivered;
  NewestJob job;

  void request(int number) {
    job.request([this, number] {
      if (number == 0) {
        begun.count_down();
        go.wait();
      }
      done.push_back(number);
      return [this, number] { delivered.push_back(number); };
    });
    if (number == 0) begun.wait();
  }
};

TEST(NewestJob, WhatWaitsIsReplaced) {
  Jobs jobs;
  for (int i = 0; i < 5; ++i) jobs.request(i);
  jobs.go.count_down();
  ASSERT_TRUE(QTest::qWaitFor([&] { return jobs.delivered.size() == 2; }));
  EXPECT_THAT(jobs.done, ElementsAre(0, 4));
  EXPECT_THAT(jobs.delivered, ElementsAre(0, 4));
}

TEST(NewestJob, WhatIsForgottenIsNotDelivered) {
  Jobs jobs;
  jobs.request(0);
  jobs.request(1);
  jobs.job.forget();
  jobs.request(2);
  jobs.go.count_down();
  ASSERT_TRUE(QTest::qWaitFor([&] { return !jobs.delivered.empty(); }));
  EXPECT_THAT(jobs.done, ElementsAre(0, 2));
  EXPECT_THAT(jobs.delivered, ElementsAre(2));
}

TEST(NewestJob, AnErrorIsSaid) {
  NewestJob job;
  QSignalSpy failed(&job, &NewestJob::failed);
  job.request([]() -> NewestJob::Delivery { fail("no channel {}", "A"); });
  ASSERT_TRUE(failed.size() == 1 || failed.wait());
  EXPECT_EQ(failed[0][0].toString(), "no channel A");
}

TEST(NewestJob, EndsWithWorkUnderWay) {
  std::atomic<bool> done = false;
  {
    Jobs jobs;
    jobs.request(0);
    jobs.go.count_down();
    jobs.job.request([&] {
      done = true;
      return [] { ADD_FAILURE() << "delivered to nobody"; };
    });
  }
}

}  // namespace
}  // namespace fathom::gui
