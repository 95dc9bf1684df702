#include "gui/frame_cache.h"

#include <sys/stat.h>

#include <QDir>
#include <QFileInfo>
#include <algorithm>
#include <chrono>

namespace fathom::gui {

namespace {

constexpr int kSettle = 200;  // ms
constexpr int kPoll = 2000;   // ms
// A file that changed so recently and cannot be read is being written: it is tried again.
constexpr std::chrono::nanoseconds kYoung = std::chrono::seconds(2);

}  // namespace

FrameCache::FrameCache(QObject* parent, Load load) : QObject(parent), load_(std::move(load)) {
  settle_.setSingleShot(true);
  settle_.setInterval(kSettle);
  connect(&settle_, &QTimer::timeout, this, &FrameCache::lookAtFiles);
  // Not begun anew by each change: a file that always changes is looked at, too.
  const auto settle = [this] {
    if (!settle_.isActive()) settle_.start();
  };
  connect(&watcher_, &QFileSystemWatcher::fileChanged, this, settle);
  connect(&watcher_, &QFileSystemWatcher::directoryChanged, this, settle);
  connect(&poll_, &QTimer::timeout, this, [this, settle] {
    if (shownChanged()) settle();
  });
  poll_.start(kPoll);
}

FrameCache::Stamp FrameCache::stampOf(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return {};
  return {int64_t(status.st_mtim.tv_sec) * 1'000'000'000 + status.st_mtim.tv_nsec, int64_t(status.st_size),
          uint64_t(status.st_ino)};
}

bool FrameCache::isYoung(const Stamp& stamp) {
  const auto age = std::chrono::system_clock::now().time_since_epoch() - std::chrono::nanoseconds(stamp.modified);
  return stamp.modified >= 0 && std::chrono::abs(age) < kYoung;  // another machine's clock may be ahead
}

bool FrameCache::isShown(const std::string& path) const {
  const auto end = wanted_.begin() + std::ptrdiff_t(std::min(shown_, wanted_.size()));
  return std::find(wanted_.begin(), end, path) != end;
}

size_t FrameCache::bytes() const {
  size_t sum = 0;
  for (const auto& [path, entry] : entries_) sum += entry.picture ? entry.picture->bytes() : 0;
  return sum;
}

void FrameCache::setLimit(size_t bytes) {
  limit_ = bytes;
  evict();
  readNext();
}

PicturePtr FrameCache::find(const std::string& path) const {
  const auto found = entries_.find(path);
  return found == entries_.end() ? nullptr : found->second.picture;
}

QString FrameCache::failure(const std::string& path) const {
  const auto found = entries_.find(path);
  return found == entries_.end() ? QString() : found->second.failure;
}

void FrameCache::want(std::vector<std::string> paths, size_t shown) {
  wanted_ = std::move(paths);
  shown_ = std::min(shown, wanted_.size());
  ++clock_;
  for (size_t i = 0; i < shown_; ++i)
    if (const auto found = entries_.find(wanted_[i]); found != entries_.end()) found->second.used = clock_;
  watch();
  evict();
  readNext();
}

void FrameCache::put(const std::string& name, PicturePtr picture) {
  Entry& entry = entries_[name];
  drop(entry.picture);
  entry = {std::move(picture), {}, {}, ++clock_, false, false};
  emit contentChanged();
}

void FrameCache::forgetMade() {
  for (auto& [name, entry] : entries_)
    if (!entry.isFile) drop(entry.picture);
  if (std::erase_if(entries_, [](const auto& of) { return !of.second.isFile; }) > 0) emit contentChanged();
}

void FrameCache::forgetFailures() {
  std::erase_if(entries_, [this](const auto& of) {
    return !of.second.picture && !of.second.failure.isEmpty() && of.first != reading_;
  });
}

// The files on the screen, for one that is written in place, and their folders, for one that is replaced or appears.
void FrameCache::watch() {
  QStringList paths;
  for (size_t i = 0; i < shown_; ++i) {
    const QFileInfo file(QString::fromStdString(wanted_[i]));
    if (file.exists()) paths << file.filePath();
    if (file.dir().exists() && !paths.contains(file.path())) paths << file.path();
  }
  QStringList gone = watcher_.files() + watcher_.directories(), fresh;
  for (const QString& path : std::as_const(paths))
    if (gone.removeAll(path) == 0) fresh << path;
  if (!gone.isEmpty()) watcher_.removePaths(gone);
  if (!fresh.isEmpty()) watcher_.addPaths(fresh);
}

bool FrameCache::shownChanged() const {
  return std::any_of(wanted_.begin(), wanted_.begin() + std::ptrdiff_t(shown_), [this](const std::string& path) {
    const auto found = entries_.find(path);
    if (found == entries_.end() || !found->second.isFile) return false;
    const Stamp now = stampOf(path);
    return now.modified >= 0 && now != found->second.stamp;
  });
}

void FrameCache::reload() {
  for (auto& [path, entry] : entries_)
    if (entry.isFile && isShown(path)) entry.changed = true;
  lookAtFiles();
}

void FrameCache::lookAtFiles() {
  bool dropped = false;
  for (auto it = entries_.begin(); it != entries_.end();) {
    auto& [path, entry] = *it;
    const Stamp now = entry.isFile ? stampOf(path) : entry.stamp;
    const bool changed = now != entry.stamp && now.modified >= 0;
    if (entry.waiting || (changed && isShown(path))) {
      entry.changed = true;
      entry.waiting = false;
    } else if (changed && path != reading_) {
      dropped |= entry.picture != nullptr;
      drop(entry.picture);
      it = entries_.erase(it);
      continue;
    }
    ++it;
  }
  if (dropped) emit contentChanged();
  watch();
  readNext();
}

void FrameCache::readNext() {
  if (!reading_.empty()) return;
  size_t sum = 0;  // of what would not go for a file further on: what was put, and the files before it
  for (const auto& [path, entry] : entries_) sum += entry.isFile || !entry.picture ? 0 : entry.picture->bytes();
  for (size_t i = 0; i < wanted_.size(); ++i) {
    const auto found = entries_.find(wanted_[i]);
    if (found != entries_.end()) {
      Entry& entry = found->second;
      if (entry.picture && entry.isFile) sum += entry.picture->bytes();
      if (entry.waiting || (!entry.changed && settled(wanted_[i]))) continue;
      entry.changed = false;
    }
    if (i >= shown_ && sum + usualBytes_ > limit_) return;
    return read(wanted_[i]);
  }
}

void FrameCache::read(const std::string& path) {
  reading_ = path;
  thread_.run([this, path, load = load_, limit = limit_] {
    Outcome outcome;
    outcome.before = stampOf(path);
    try {
      outcome.picture = load ? load(path) : loadPicture(path, limit);
    } catch (...) {
      outcome.failure = describeException();
    }
    outcome.after = stampOf(path);
    caller_.call([this, path, outcome] { arrived(path, outcome); });
  });
}

void FrameCache::arrived(const std::string& path, const Outcome& outcome) {
  reading_.clear();
  Entry& entry = entries_[path];
  entry.stamp = outcome.after;
  entry.waiting = outcome.before != outcome.after || (!outcome.picture && isYoung(outcome.after));
  if (entry.waiting) {
    settle_.start();
    return readNext();
  }
  entry.failure = outcome.failure;
  if (outcome.picture) {
    drop(entry.picture);
    entry.picture = outcome.picture;
    entry.used = ++clock_;
    usualBytes_ = entry.picture->bytes();
  }
  evict();
  if (outcome.picture)
    emit loaded(path);
  else
    emit failed(path, outcome.failure);
  emit contentChanged();
  readNext();
}

// In another thread: large pictures take a while to free.
void FrameCache::drop(PicturePtr& picture) {
  if (!picture) return;
  dropping_.run([held = std::move(picture)] {});
  picture.reset();
}

// Those not wanted, by their last use; then the wanted ones from the end.
void FrameCache::evict() {
  size_t sum = bytes();
  while (sum > limit_) {
    auto victim = entries_.end();
    std::pair<size_t, uint64_t> best;  // place from the end of what is wanted, use; the smallest goes
    for (auto it = entries_.begin(); it != entries_.end(); ++it) {
      if (!it->second.picture || !it->second.isFile || isShown(it->first)) continue;
      const auto place = std::ranges::find(wanted_, it->first);
      const std::pair rank{place == wanted_.end() ? 0 : size_t(wanted_.end() - place), it->second.used};
      if (victim == entries_.end() || rank < best) victim = it, best = rank;
    }
    if (victim == entries_.end()) return;
    sum -= victim->second.picture->bytes();
    drop(victim->second.picture);
    entries_.erase(victim);
  }
}

}  // namespace fathom::gui
