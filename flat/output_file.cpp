#include "flat/output_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "base/error.h"

namespace fathom {

namespace {

// The file that a symbolic link leads to is replaced, not the link.
std::string target(const std::string& path) {
  std::error_code none;
  const auto status = std::filesystem::status(path, none);
  if (!std::filesystem::exists(status)) return path;
  if (!std::filesystem::is_regular_file(status)) fail("{}: cannot write: expected a file, found something else", path);
  if (::access(path.c_str(), W_OK) != 0) fail("{}: cannot write: {}", path, std::strerror(errno));
  return std::filesystem::canonical(path).string();
}

}  // namespace

OutputFile::OutputFile(const std::string& path) : path_(target(path)) {
  for (int i = 0; fd_ < 0; ++i) {
    temporary_ = fmt::format("{}.{}-{}.tmp", path_, ::getpid(), i);
    fd_ = ::open(temporary_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd_ < 0 && errno != EEXIST) fail("{}: cannot write: {}", path, std::strerror(errno));
  }
}

OutputFile::~OutputFile() {
  if (fd_ < 0) return;
  ::close(fd_);
  ::unlink(temporary_.c_str());
}

uint64_t OutputFile::append(std::span<const uint8_t> bytes) {
  const uint64_t at = size_;
  size_ += bytes.size();
  overwrite(at, bytes);
  return at;
}

void OutputFile::overwrite(uint64_t offset, std::span<const uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::pwrite(fd_, bytes.data(), bytes.size(), off_t(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) fail("{}: cannot write: {}", path_, std::strerror(n < 0 ? errno : ENOSPC));
    offset += uint64_t(n);
    bytes = bytes.subspan(size_t(n));
  }
}

void OutputFile::finish() {
  if (::fsync(fd_) != 0) fail("{}: cannot write: {}", path_, std::strerror(errno));
  if (::close(std::exchange(fd_, -1)) != 0 || ::rename(temporary_.c_str(), path_.c_str()) != 0) {
    const int error = errno;
    ::unlink(temporary_.c_str());
    fail("{}: cannot write: {}", path_, std::strerror(error));
  }
}

}  // namespace fathom
