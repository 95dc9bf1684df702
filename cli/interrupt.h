// Ctrl-C and the farm's SIGTERM as a stop token: work ends at its next step, and half-written files go with it.
#pragma once

#include <csignal>
#include <stop_token>
#include <thread>

namespace fathom::cli {

// While it lives, the first SIGINT or SIGTERM requests a stop; a second one ends the process at once. Construct it
// before any other thread starts.
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;

  std::stop_token token() const { return stop_.get_token(); }

 private:
  std::stop_source stop_;
  sigset_t before_;
  std::jthread watcher_;
};

}  // namespace fathom::cli
