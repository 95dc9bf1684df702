// Where a run over frames tells how far it is: a terminal, or a window.
#pragma once

#include <string>

namespace fathom::cli {

// Called from one thread at a time.
class ProgressSink {
 public:
  virtual ~ProgressSink() = default;

  // The frame that is worked on is done by this fraction.
  virtual void at(double fraction) = 0;
  // A frame is done; the line is empty where it failed.
  virtual void frameDone(const std::string& line) = 0;
  // A line for the user that is no result.
  virtual void tell(const std::string& line) = 0;
};

}  // namespace fathom::cli
