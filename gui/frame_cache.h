// Pictures by file name, read in the background and kept as long as the memory lasts.
#pragma once

#include <QFileSystemWatcher>
#include <QObject>
#include <QString>
#include <QTimer>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "base/worker.h"
#include "gui/background.h"
#include "gui/picture.h"

namespace fathom::gui {

class FrameCache : public QObject {
  Q_OBJECT

 public:
  // Reads a file; called in one thread, for one file at a time. Throws Error. By default loadPicture, within the limit.
  using Load = std::function<PicturePtr(const std::string& path)>;

  explicit FrameCache(QObject* parent = nullptr, Load load = {});
  // Waits for the file that is being read.
  ~FrameCache() override = default;

  // What the pictures may take together. Those shown stay even where they are larger; of the others those go first that
  // are not wanted, the least recently used one before others, then those that are wanted last. What was put stays, too.
  void setLimit(size_t bytes);
  size_t limit() const { return limit_; }
  size_t bytes() const;

  // The files to have, the most urgent first, of which the first `shown` are on the screen. They are read in this order
  // as far as the limit allows; what was wanted before and is not read yet is forgotten. The files on the screen are
  // watched, and read again when they change; of the others, those that changed in the same folder are.
  void want(std::vector<std::string> paths, size_t shown);
  // A picture that is not a file's, under a name that is none: it cannot be read again, and stays until forgetMade().
  void put(const std::string& name, PicturePtr picture);
  void forgetMade();
  // What could not be read is tried again when it is wanted next.
  void forgetFailures();
  // Reads the files on the screen again, and forgets others that have changed.
  void reload();

  // Null: not there (yet).
  PicturePtr find(const std::string& path) const;
  // Why a file could not be read; empty: it could, or was not tried.
  QString failure(const std::string& path) const;
  // Whether there is a picture or a reason why there is none.
  bool settled(const std::string& path) const { return find(path) || !failure(path).isEmpty(); }

 signals:
  void loaded(const std::string& path);
  // Told once; tried again when the file changes. A picture that was there before stays.
  void failed(const std::string& path, const QString& reason);
  // Pictures came or went.
  void contentChanged();

 private:
  // What tells one state of a file from the next.
  struct Stamp {
    int64_t modified = -1;  // ns; -1: there is no such file
    int64_t size = 0;
    uint64_t node = 0;
    bool operator==(const Stamp&) const = default;
  };
  struct Entry {
    PicturePtr picture;
    QString failure;
    Stamp stamp;
    uint64_t used = 0;
    bool isFile = true;
    bool changed = false;  // to be read again
    bool waiting = false;  // it was caught half-written: to be read again when it has settled
  };
  struct Outcome {
    PicturePtr picture;
    QString failure;
    Stamp before, after;  // of the file, around its reading
  };

  static Stamp stampOf(const std::string& path);
  static bool isYoung(const Stamp& stamp);
  bool isShown(const std::string& path) const;
  void watch();
  bool shownChanged() const;
  void lookAtFiles();
  void readNext();
  void read(const std::string& path);
  void arrived(const std::string& path, const Outcome& outcome);
  void drop(PicturePtr& picture);
  void evict();

  Load load_;
  size_t limit_ = size_t(8) << 30;
  std::map<std::string, Entry> entries_;
  std::vector<std::string> wanted_;
  size_t shown_ = 0;
  uint64_t clock_ = 0;
  size_t usualBytes_ = 0;  // of the last picture that was read
  std::string reading_;    // empty: nothing
  QFileSystemWatcher watcher_;
  QTimer settle_;  // files are looked at a moment after they have changed
  QTimer poll_;    // for folders of other machines, which the watcher does not hear of
  Caller caller_;
  Worker thread_;
  Worker dropping_;
};

}  // namespace fathom::gui
