// How a long operation tells how far it is, and how it is told to stop.
#pragma once

#include <exception>
#include <functional>
#include <stop_token>

namespace fathom {

// Thrown by an operation whose stop token was raised; its output is not to be used.
struct Cancelled : std::exception {
  const char* what() const noexcept override { return "cancelled"; }
};

struct Progress {
  std::function<void(double done)> report;  // done in [0,1], never falling, from one thread at a time; may be empty
  std::stop_token stop;

  void at(double done) const {
    if (stop.stop_requested()) throw Cancelled();
    if (report) report(done);
  }
};

}  // namespace fathom
