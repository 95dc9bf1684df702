// The thread with a queue that stages and the viewer run in.
#include "base/worker.h"

#include <gmock/gmock.h>

#include <future>
#include <memory>
#include <semaphore>
#include <thread>
#include <vector>

#include "base/error.h"

namespace fathom {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::Ne;

TEST(Worker, RunsEverythingInOrderBeforeItGoes) {
  std::vector<int> ran, gone;
  std::vector<std::thread::id> where;
  {
    std::binary_semaphore gate(0);
    Worker worker;
    worker.run([&] { gate.acquire(); });
    for (const int number : {1, 2, 3}) {
      const std::shared_ptr<void> held(nullptr, [&gone, number](void*) { gone.push_back(number); });
      worker.run([&ran, &where, number, held] {
        ran.push_back(number);
        where.push_back(std::this_thread::get_id());
      });
    }
    EXPECT_TRUE(ran.empty());
    gate.release();
  }
  EXPECT_THAT(ran, ElementsAre(1, 2, 3));
  EXPECT_THAT(gone, ElementsAre(1, 2, 3));
  EXPECT_THAT(where, Each(Ne(std::this_thread::get_id())));
}

TEST(Worker, GivesResultsAndThrowsOnFromOneThread) {
  Worker worker;
  std::vector<std::thread::id> where;
  std::future<int> number = worker.result([&] {
    where.push_back(std::this_thread::get_id());
    return 3;
  });
  std::future<void> failing = worker.result([&] {
    where.push_back(std::this_thread::get_id());
    throw Error("no more paper");
  });
  std::promise<int> promise;  // what can only be moved goes, too
  std::future<int> promised = promise.get_future();
  worker.result([&, promise = std::move(promise)]() mutable {
    where.push_back(std::this_thread::get_id());
    promise.set_value(5);
  });
  EXPECT_EQ(number.get(), 3);
  EXPECT_THROW(failing.get(), Error);
  EXPECT_EQ(promised.get(), 5);
  EXPECT_THAT(where, Each(where.front()));
  EXPECT_NE(where.front(), std::this_thread::get_id());
}

}  // namespace
}  // namespace fathom
