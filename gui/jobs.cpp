#include "gui/jobs.h"

#include <algorithm>
#include <utility>

namespace fathom::gui {

namespace {

constexpr double kStep = 0.002;  // of the progress, below which it is not told

}  // namespace

Jobs::Jobs(QObject* parent) : QObject(parent) {}

Jobs::~Jobs() {
  stop_.request_stop();
}

double Jobs::seconds() const {
  return running_ ? double(since_.elapsed()) / 1000 : 0;
}

void Jobs::add(Job job) {
  const auto same = std::ranges::find(waiting_, job.kind, &Job::kind);
  if (same != waiting_.end())
    *same = std::move(job);
  else
    waiting_.push_back(std::move(job));
  startNext();
  emit changed();
}

void Jobs::cancel() {
  stop_.request_stop();
}

void Jobs::cancelAll() {
  waiting_.clear();
  cancel();
  emit changed();
}

void Jobs::startNext() {
  if (running_ || waiting_.empty()) return;
  Job job = std::move(waiting_.front());
  waiting_.pop_front();
  running_ = true;
  name_ = job.name;
  done_ = 0;
  since_.start();
  stop_ = std::stop_source();
  const auto report = [this, told = 0.0](double done) mutable {
    if (done < told + kStep) return;
    told = done;
    const auto tell = [this, done] {
      done_ = done;
      emit progressed(done);
    };
    caller_.call(tell);
  };
  thread_.run([this, work = std::move(job.work), progress = Progress{report, stop_.get_token()}]() mutable {
    Outcome outcome;
    try {
      outcome.deliver = work(progress);
    } catch (const Cancelled&) {
      outcome.cancelled = true;
    } catch (...) {
      outcome.error = describeException();
    }
    work = nullptr;  // what it holds goes in this thread
    caller_.call([this, outcome] { arrived(outcome); });
  });
}

void Jobs::arrived(const Outcome& outcome) {
  const QString name = std::exchange(name_, QString());
  const double took = seconds();
  running_ = false;
  // A result that came in spite of the stop is not wanted any more.
  if (outcome.cancelled || (outcome.error.isEmpty() && stop_.stop_requested())) {
    emit cancelled(name);
  } else if (!outcome.error.isEmpty()) {
    emit failed(name, outcome.error);
  } else {
    if (outcome.deliver) outcome.deliver();
    emit finished(name, took);
  }
  startNext();
  emit changed();
}

}  // namespace fathom::gui
