// A thread with a queue.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>

namespace fathom::gui {

// Runs what it is given in a thread of its own, in the order that it comes. Not a QThreadPool: inside Debian's Qt,
// ThreadSanitizer cannot see how work is handed over.
class Worker {
 public:
  Worker();
  // Runs what waits, and waits for it.
  ~Worker() = default;
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  // `what` must not throw; it is destroyed in the thread.
  void run(std::function<void()> what);

 private:
  void work(const std::stop_token& ended);

  std::mutex mutex_;  // of:
  std::deque<std::function<void()>> waiting_;
  std::condition_variable_any came_;
  std::jthread thread_;
};

}  // namespace fathom::gui
