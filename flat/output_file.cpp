#include "flat/output_file.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string_view>
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

std::string machineName() {
  char name[256] = "";
  ::gethostname(name, sizeof name - 1);
  return name;
}

// What stands behind the name of a file in that of one that this process writes for it.
std::string markOf(pid_t process, int number) {
  return fmt::format(".{}-{}-{}.tmp", machineName(), process, number);
}

// The process that writes under such a name, if it is one of this machine.
std::optional<pid_t> processOf(std::string_view mark) {
  const std::string begin = fmt::format(".{}-", machineName());
  if (!mark.starts_with(begin)) return {};
  pid_t process = 0;
  const char* end = mark.data() + mark.size();
  const auto [rest, error] = std::from_chars(mark.data() + begin.size(), end, process);
  if (error != std::errc() || rest == end || *rest != '-') return {};
  return process;
}

bool isAbandoned(const std::filesystem::path& file, std::string_view mark) {
  if (const std::optional<pid_t> process = processOf(mark)) return ::kill(*process, 0) != 0 && errno == ESRCH;
  std::error_code none;
  const auto written = std::filesystem::last_write_time(file, none);
  return !none && std::filesystem::file_time_type::clock::now() - written > std::chrono::hours(1);
}

}  // namespace

void removeAbandoned(const std::string& path) {
  std::error_code none;
  const std::filesystem::path resolved = std::filesystem::weakly_canonical(path, none);
  const std::string begin = fmt::format("{}.", resolved.filename().string());
  for (const auto& entry : std::filesystem::directory_iterator(resolved.parent_path(), none)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(begin) || !name.ends_with(".tmp")) continue;
    if (isAbandoned(entry.path(), std::string_view(name).substr(begin.size() - 1)))
      std::filesystem::remove(entry.path(), none);
  }
}

OutputFile::OutputFile(const std::string& path) : path_(target(path)) {
  for (int i = 0; fd_ < 0; ++i) {
    temporary_ = path_ + markOf(::getpid(), i);
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
