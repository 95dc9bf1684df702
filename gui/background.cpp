#include "gui/background.h"

#include <CLI/Error.hpp>
#include <exception>
#include <new>
#include <utility>

#include "base/error.h"

namespace fathom::gui {

QString describeException() {
  try {
    throw;
  } catch (const Cancelled&) {
    return {};
  } catch (const std::bad_alloc&) {
    return QStringLiteral("expected more memory than there is");
  } catch (const CLI::ValidationError& e) {  // "-o: expected ...", of a command line that is not there
    return QString::fromStdString(oneLine(e.what())).section(": ", 1);
  } catch (const std::exception& e) {
    return QString::fromStdString(oneLine(e.what()));
  }
}

Caller::Caller() {
  connect(this, &Caller::came, this, &Caller::callNext, Qt::QueuedConnection);
}

void Caller::call(std::function<void()> what) {
  {
    const std::scoped_lock lock(mutex_);
    waiting_.push_back(std::move(what));
  }
  emit came();
}

void Caller::callNext() {
  std::function<void()> what;
  {
    const std::scoped_lock lock(mutex_);
    what = std::move(waiting_.front());
    waiting_.pop_front();
  }
  what();
}

Background::Background(QObject* parent) : QObject(parent) {}

Background::~Background() {
  stop_.request_stop();
}

void Background::run(Work work) {
  if (running_)
    waiting_ = std::move(work);
  else
    start(std::move(work));
}

void Background::clear() {
  waiting_ = nullptr;
  ++generation_;
  stop_.request_stop();
}

void Background::start(Work work) {
  running_ = true;
  stop_ = std::stop_source();
  thread_.run([this, work = std::move(work), generation = generation_, token = stop_.get_token()]() mutable {
    Deliver deliver;
    QString error;
    try {
      deliver = work(Progress{{}, token});
    } catch (...) {
      error = describeException();
    }
    work = nullptr;  // what it holds goes in this thread
    caller_.call([this, generation, deliver, error] { arrived(generation, deliver, error); });
  });
}

void Background::arrived(uint64_t generation, const Deliver& deliver, const QString& error) {
  running_ = false;
  if (waiting_) start(std::exchange(waiting_, nullptr));
  if (generation == generation_) {
    if (!error.isEmpty()) emit failed(error);
    if (deliver) deliver();
  }
  if (!running_) emit idle();
}

}  // namespace fathom::gui
