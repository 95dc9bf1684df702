// The signals are blocked in all threads and taken by one that waits for them: no handler, nothing that has to be
// signal-safe.
#include "cli/interrupt.h"

#include <unistd.h>
#include <ctime>

#include "cli/commands.h"

namespace fathom::cli {

Interrupt::Interrupt() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, &before_);
  watcher_ = std::jthread([this, signals](const std::stop_token& ended) {
    const timespec wait{0, 50'000'000};
    while (!ended.stop_requested()) {
      if (sigtimedwait(&signals, nullptr, &wait) < 0) continue;
      if (stop_.stop_requested()) _exit(kInterrupted);
      stop_.request_stop();
    }
  });
}

Interrupt::~Interrupt() {
  watcher_.request_stop();
  watcher_.join();
  pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

}  // namespace fathom::cli
