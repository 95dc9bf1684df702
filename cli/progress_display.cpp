#include "cli/progress_display.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace fathom::cli {

namespace {

constexpr int kBarWidth = 30;
constexpr double kRedraw = 0.1;  // seconds

}  // namespace

std::string describeTime(double seconds) {
  const auto whole = std::llround(std::max(0.0, seconds));
  const int64_t hours = whole / 3600, minutes = whole / 60 % 60;
  return hours > 0 ? fmt::format("{}:{:02}:{:02}", hours, minutes, whole % 60)
                   : fmt::format("{}:{:02}", minutes, whole % 60);
}

ProgressDisplay::ProgressDisplay(size_t frames)
    : frames_(frames),
      terminal_(isatty(STDOUT_FILENO) != 0),
      start_(std::chrono::steady_clock::now()),
      drawn_(start_) {}

ProgressDisplay::~ProgressDisplay() {
  clear();
}

void ProgressDisplay::clear() {
  if (!terminal_) return;
  fmt::print("\r\033[K");
  std::fflush(stdout);
}

void ProgressDisplay::draw(double fraction) {
  const auto now = std::chrono::steady_clock::now();
  if (!terminal_ || std::chrono::duration<double>(now - drawn_).count() < kRedraw) return;
  drawn_ = now;
  const double done = std::min(1.0, (double(done_) + fraction) / double(std::max<size_t>(1, frames_)));
  const double spent = std::chrono::duration<double>(now - start_).count();
  const int filled = int(done * kBarWidth);
  fmt::print("\r[{:=<{}}{: <{}}] {}/{} frames, {} left\033[K", "", filled, "", kBarWidth - filled, done_, frames_,
             done > 0.01 ? describeTime(spent / done * (1 - done)) : "?:??");
  std::fflush(stdout);
}

void ProgressDisplay::at(double fraction) {
  const std::lock_guard lock(mutex_);
  draw(fraction);
}

void ProgressDisplay::frameDone(const std::string& line) {
  const std::lock_guard lock(mutex_);
  ++done_;
  if (terminal_) return draw(0);
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

void ProgressDisplay::say(const std::string& line) {
  const std::lock_guard lock(mutex_);
  clear();
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

void ProgressDisplay::tell(const std::string& line) {
  const std::lock_guard lock(mutex_);
  clear();
  fmt::print(stderr, "{}\n", line);
}

}  // namespace fathom::cli
