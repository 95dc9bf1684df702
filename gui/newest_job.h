// Work beside the window, one job after the other; of those that wait, the newest alone is done.
#pragma once

#include <QObject>
#include <QString>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace fathom::gui {

class NewestJob : public QObject {
  Q_OBJECT

 public:
  using Delivery = std::function<void()>;

  explicit NewestJob(QObject* parent = nullptr);
  ~NewestJob() override;  // waits for what is under way

  // `work` runs in a thread of its own; what it returns is called in the thread that this object lives in. A job that
  // waits is forgotten; one that is under way is finished and delivered, so that whoever follows a cursor that never
  // rests has something to show.
  void request(std::function<Delivery()> work);
  // Nothing of what was requested so far is delivered.
  void forget();

 signals:
  // The work threw.
  void failed(const QString& reason);

 private:
  void run(const std::stop_token& stop);
  Delivery attempt(const std::function<Delivery()>& work);

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::function<Delivery()> waiting_;
  size_t generation_ = 0;  // of what is delivered
  std::jthread thread_;    // last, for it uses all of the above
};

}  // namespace fathom::gui
