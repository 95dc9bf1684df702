// Who makes a frame: any number of processes, on any number of machines, may work on one sequence.
//
// A claim is a lock on the file OUTPUT.claim beside the output. The system drops it with the process that holds it, however
// that ends (on a network file system when the server notices), so that no frame is lost to one that was killed.
#pragma once

#include <memory>
#include <string>

namespace fathom::cli {

class Claim {
 public:
  // Null where another process has it. Whoever gets a claim looks again whether the output is there: another one may have
  // made it in between. What a killed process left half written beside the output is removed. Throws an Error where nothing
  // can be written there.
  static std::shared_ptr<const Claim> take(const std::string& output);

  // Of an output that is done: removes the claim of a process that was killed just before it did so itself.
  static void clear(const std::string& output);

  Claim(const Claim&) = delete;
  Claim& operator=(const Claim&) = delete;
  ~Claim();

  // False on file systems that lock nothing: there, two processes may make the same frame, each of them whole.
  bool exclusive() const { return exclusive_; }

 private:
  Claim(std::string path, int fd, bool exclusive) : path_(std::move(path)), fd_(fd), exclusive_(exclusive) {}

  std::string path_;
  int fd_;
  bool exclusive_;
};

}  // namespace fathom::cli
