#include "gui/newest_job.h"

#include <exception>
#include <utility>

namespace fathom::gui {

NewestJob::NewestJob(QObject* parent) : QObject(parent) {
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

NewestJob::~NewestJob() {
  thread_.request_stop();
  thread_.join();
}

void NewestJob::request(std::function<Delivery()> work) {
  const std::scoped_lock lock(mutex_);
  waiting_ = std::move(work);
  changed_.notify_one();
}

void NewestJob::forget() {
  const std::scoped_lock lock(mutex_);
  waiting_ = nullptr;
  ++generation_;
}

void NewestJob::run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return bool(waiting_); })) {
    if (stop.stop_requested()) return;
    std::function<Delivery()> work = std::exchange(waiting_, nullptr);
    const size_t generation = generation_;
    lock.unlock();
    Delivery delivery = attempt(work);
    work = nullptr;  // what it holds goes in this thread
    QMetaObject::invokeMethod(
        this,
        [this, generation, delivery = std::move(delivery)] {
          if (generation == generation_) delivery();
        },
        Qt::QueuedConnection);
    lock.lock();
  }
}

NewestJob::Delivery NewestJob::attempt(const std::function<Delivery()>& work) {
  try {
    return work();
  } catch (const std::exception& e) {
    return [this, reason = QString::fromStdString(e.what())] { emit failed(reason); };
  }
}

}  // namespace fathom::gui
