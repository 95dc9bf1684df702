// A thread with a queue.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <stop_token>
#include <thread>
#include <type_traits>
#include <utility>

namespace fathom {

// Runs what it is given in a thread of its own, in the order that it comes. Not a QThreadPool: inside Debian's Qt,
// ThreadSanitizer cannot see how work is handed over. Not std::async for each piece either: what allocators and oneTBB
// keep for a thread grows with the number of threads that ever were.
class Worker {
 public:
  Worker() : thread_([this](const std::stop_token& ended) { work(ended); }) {}
  // Runs what waits, and waits for it.
  ~Worker() = default;
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  // `what` must not throw; it is destroyed in the thread.
  void run(std::function<void()> what) {
    {
      const std::scoped_lock lock(mutex_);
      waiting_.push_back(std::move(what));
    }
    came_.notify_one();
  }

  // The same for what has a result, or throws.
  template <class What>
  std::future<std::invoke_result_t<What&>> result(What what) {
    // A std::function must be copyable, a task is not.
    auto task = std::make_shared<std::packaged_task<std::invoke_result_t<What&>()>>(std::move(what));
    auto future = task->get_future();
    run([task = std::move(task)] { (*task)(); });
    return future;
  }

 private:
  void work(const std::stop_token& ended) {
    std::unique_lock lock(mutex_);
    while (came_.wait(lock, ended, [this] { return !waiting_.empty(); })) {
      std::function<void()> what = std::move(waiting_.front());
      waiting_.pop_front();
      lock.unlock();
      what();
      what = nullptr;
      lock.lock();
    }
  }

  std::mutex mutex_;  // of:
  std::deque<std::function<void()>> waiting_;
  std::condition_variable_any came_;
  std::jthread thread_;
};

}  // namespace fathom
