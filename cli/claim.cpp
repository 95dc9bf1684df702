#include "cli/claim.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "flat/output_file.h"

namespace fathom::cli {

namespace {

std::string claimOn(const std::vector<std::string>& outputs) {
  return fmt::format("{}.claim", outputs.front());
}

// Whether the file at `path` is still the one that was opened: its last owner may have removed it meanwhile.
bool isThere(const std::string& path, int fd) {
  struct stat opened, there;
  return ::fstat(fd, &opened) == 0 && ::stat(path.c_str(), &there) == 0 && opened.st_dev == there.st_dev &&
         opened.st_ino == there.st_ino;
}

}  // namespace

std::shared_ptr<const Claim> Claim::take(const std::vector<std::string>& outputs) {
  std::string path = claimOn(outputs);
  while (true) {
    const bool left = ::access(path.c_str(), F_OK) == 0;
    const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (fd < 0) fail("{}: cannot write: {}", outputs.front(), std::strerror(errno));
    struct flock lock {};
    lock.l_type = F_WRLCK;
    lock.l_whence = SEEK_SET;
    const bool refused = ::fcntl(fd, F_OFD_SETLK, &lock) != 0 && (errno == EAGAIN || errno == EACCES);
    if (!refused && isThere(path, fd)) {
      std::shared_ptr<const Claim> claim(new Claim(std::move(path), fd));
      if (left)  // by a process that is no more
        for (const std::string& output : outputs) removeAbandoned(output);
      return claim;
    }
    ::close(fd);
    if (refused) return nullptr;
  }
}

void Claim::clear(const std::vector<std::string>& outputs) {
  if (::access(claimOn(outputs).c_str(), F_OK) == 0) take(outputs);
}

Claim::~Claim() {
  ::unlink(path_.c_str());
  ::close(fd_);
}

}  // namespace fathom::cli
