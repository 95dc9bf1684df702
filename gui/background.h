// Work in the background of which only the newest matters.
#pragma once

#include <QObject>
#include <QString>
#include <deque>
#include <functional>
#include <mutex>
#include <stop_token>

#include "base/progress.h"
#include "base/worker.h"

namespace fathom::gui {

// The exception that is being handled, as one line.
QString describeException();

// Calls functions in the thread that it lives in, later and in the order that they come; nothing once it is gone. Qt
// wakes it; the functions go by a queue of its own (see Worker).
class Caller : public QObject {
  Q_OBJECT

 public:
  Caller();
  // From any thread.
  void call(std::function<void()> what);

 signals:
  void came();

 private:
  void callNext();

  std::mutex mutex_;  // of:
  std::deque<std::function<void()>> waiting_;
};

// One thing runs at a time. What waits is replaced by what comes later.
class Background : public QObject {
  Q_OBJECT

 public:
  // What is called with the result, in the thread that this lives in.
  using Deliver = std::function<void()>;
  // Runs in another thread; Error and other exceptions become failed(), Cancelled nothing.
  using Work = std::function<Deliver(const Progress& progress)>;

  explicit Background(QObject* parent = nullptr);
  // Waits for what runs.
  ~Background() override;

  // Replaces what waits. What runs comes to its end and delivers: a slider that is dragged shows what it can.
  void run(Work work);
  // What waits is forgotten, what runs is asked to stop and does not deliver.
  void clear();
  bool busy() const { return running_; }

 signals:
  void failed(const QString& line);
  void idle();

 private:
  void start(Work work);
  void arrived(uint64_t generation, const Deliver& deliver, const QString& error);

  bool running_ = false;
  Work waiting_;
  uint64_t generation_ = 0;  // of what may still deliver
  std::stop_source stop_;
  Caller caller_;
  Worker thread_;
};

}  // namespace fathom::gui
