// Who makes a frame: any number of processes, on any number of machines, may work on one sequence.
//
// A claim is a lock on the file OUTPUT.claim beside the output. The system drops it with the process that holds it, however
// that ends (on a network file system when the server notices), so that no frame is lost to one that was killed.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace fathom::cli {

class Claim {
 public:
  // On all outputs of a frame, by the lock on the first. Null where another process has it. Whoever gets a claim looks again
  // whether the outputs are there: another one may have made them in between. What a killed process left half written
  // beside them is removed. On file systems that lock nothing, everybody gets it: two processes may then make the same
  // frame, each of them whole. Throws an Error where nothing can be written there.
  static std::shared_ptr<const Claim> take(const std::vector<std::string>& outputs);

  // Of outputs that are done: removes the claim of a process that was killed just before it did so itself.
  static void clear(const std::vector<std::string>& outputs);

  Claim(const Claim&) = delete;
  Claim& operator=(const Claim&) = delete;
  ~Claim();

 private:
  Claim(std::string path, int fd) : path_(std::move(path)), fd_(fd) {}

  std::string path_;
  int fd_;
};

}  // namespace fathom::cli
