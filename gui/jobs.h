// Work that takes its time, one after the other: with progress, and a way to stop it.
#pragma once

#include <QElapsedTimer>
#include <QObject>
#include <QString>
#include <deque>
#include <functional>
#include <stop_token>

#include "base/progress.h"
#include "base/worker.h"
#include "gui/background.h"

namespace fathom::gui {

struct Job {
  QString kind;  // a job that waits is replaced by a later one of its kind
  QString name;  // "Denoising beauty.0001.exr"
  // In another thread. Throws Error and Cancelled; what it returns is called in the thread of Jobs when all went well.
  std::function<std::function<void()>(const Progress& progress)> work;
};

class Jobs : public QObject {
  Q_OBJECT

 public:
  explicit Jobs(QObject* parent = nullptr);
  // Stops what runs, and waits for it.
  ~Jobs() override;

  void add(Job job);
  bool busy() const { return running_; }
  QString name() const { return running_ ? name_ : QString(); }  // of the one that runs
  double done() const { return done_; }                          // of it, in [0,1]
  double seconds() const;                                        // since it began
  int waiting() const { return int(waiting_.size()); }

  // Stops the one that runs; the next one begins when it has ended.
  void cancel();
  // Stops it, and forgets those that wait.
  void cancelAll();

 signals:
  // Another one runs, or none, or another number waits.
  void changed();
  void progressed(double done);
  void finished(const QString& name, double seconds);
  void failed(const QString& name, const QString& line);
  void cancelled(const QString& name);

 private:
  struct Outcome {
    std::function<void()> deliver;
    QString error;
    bool cancelled = false;
  };
  void startNext();
  void arrived(const Outcome& outcome);

  bool running_ = false;
  QString name_;
  double done_ = 0;
  QElapsedTimer since_;
  std::stop_source stop_;
  std::deque<Job> waiting_;
  Caller caller_;
  Worker thread_;
};

}  // namespace fathom::gui
