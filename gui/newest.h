// A place for one thing to do: a newer one takes the place of what waits there, and asks what is under way to stop.
#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <stop_token>
#include <utility>

namespace fathom::gui {

template <class T>
class Newest {
 public:
  struct Taken {
    T value;
    std::stop_token newer;  // raised as soon as something newer is put
  };

  void put(T value) {
    {
      const std::lock_guard lock(guard_);
      waiting_ = std::move(value);
      newer_.request_stop();
    }
    put_.notify_one();
  }

  // Waits for something; nothing when `stop` is raised.
  std::optional<Taken> take(std::stop_token stop) {
    std::unique_lock lock(guard_);
    if (!put_.wait(lock, stop, [this] { return waiting_.has_value(); }) || stop.stop_requested()) return {};
    newer_ = {};
    Taken taken{std::move(*waiting_), newer_.get_token()};
    waiting_.reset();
    return taken;
  }

  // Forgets what waits, and asks what is under way to stop.
  void clear() {
    const std::lock_guard lock(guard_);
    waiting_.reset();
    newer_.request_stop();
  }

 private:
  std::mutex guard_;
  std::condition_variable_any put_;
  std::optional<T> waiting_;
  std::stop_source newer_;
};

}  // namespace fathom::gui
