// What the user sees while frames are worked on: a bar with the time left on a terminal, a line per frame otherwise.
#pragma once

#include <chrono>
#include <mutex>
#include <string>

#include "cli/progress_sink.h"

namespace fathom::cli {

class ProgressDisplay : public ProgressSink {
 public:
  explicit ProgressDisplay(size_t frames);
  ~ProgressDisplay() override;

  void at(double fraction) override;
  // The line is shown where there is no bar.
  void frameDone(const std::string& line) override;
  // A line of a result, on the standard output, above the bar.
  void say(const std::string& line);
  // On stderr, above the bar.
  void tell(const std::string& line) override;

 private:
  void draw(double fraction);
  void clear();

  std::mutex mutex_;
  const size_t frames_;
  const bool terminal_;
  const std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point drawn_;
  size_t done_ = 0;
};

// "0:07", "12:05", "3:00:10".
std::string describeTime(double seconds);

}  // namespace fathom::cli
