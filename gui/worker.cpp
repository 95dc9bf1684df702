#include "gui/worker.h"

#include <utility>

namespace fathom::gui {

Worker::Worker() : thread_([this](const std::stop_token& ended) { work(ended); }) {}

void Worker::run(std::function<void()> what) {
  {
    const std::scoped_lock lock(mutex_);
    waiting_.push_back(std::move(what));
  }
  came_.notify_one();
}

void Worker::work(const std::stop_token& ended) {
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

}  // namespace fathom::gui
