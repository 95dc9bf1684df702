// What the user sees while frames are worked on: a bar with the time left on a terminal, a line per frame otherwise.
#pragma once

#include <chrono>
#include <mutex>
#include <string>

namespace fathom::cli {

class ProgressDisplay {
 public:
  explicit ProgressDisplay(size_t frames);
  ~ProgressDisplay();

  // The frame that is worked on is done by this fraction.
  void at(double fraction);
  // A frame is done (or failed): the line is shown where there is no bar.
  void frameDone(const std::string& line);
  // A line of a result, on the standard output, above the bar.
  void say(const std::string& line);
  // A line for the user that is no result: on stderr, above the bar.
  void tell(const std::string& line);

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
