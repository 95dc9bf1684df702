// What is open: A, and B to compare it with, each a file or a sequence, and the frame of both that is on the screen.
#pragma once

#include <QObject>
#include <QString>
#include <QStringList>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cli/sequence.h"
#include "gui/frame_cache.h"
#include "gui/player.h"
#include "gui/session.h"

namespace fathom::gui {

// Where pictures come from.
struct Source {
  cli::FilePattern pattern;
  std::vector<int> frames;  // {0} for a plain file
  QString made;             // what was made of these files, such as "denoised"; empty: the files themselves

  bool isSequence() const { return pattern.numbered() && frames.size() > 1; }
  // The name of the picture of a frame: a file's, where nothing was made of it.
  std::string at(int frame) const;
};

// The source that a name stands for, and the frame to begin with: a pattern such as name.####.exr; or a file, with its
// whole sequence where it has neighbours and `asSequence`. Throws Error where a pattern finds nothing.
struct Found {
  Source source;
  int frame;
};
Found findSource(const QString& path, bool asSequence = true);

// Names and patterns without the files that belong to the sequence of an earlier one: "a.1.exr a.2.exr b.exr" are two.
QStringList distinctSources(const QStringList& paths);

class Frames : public QObject {
  Q_OBJECT

 public:
  // Takes the pictures of a frame to the screen, at once or later; b may be null.
  using Show = std::function<void(const PicturePtr& a, const PicturePtr& b)>;

  explicit Frames(Session& session, QObject* parent = nullptr, FrameCache::Load load = {});

  Player& player() { return player_; }
  FrameCache& cache() { return cache_; }
  const std::optional<Source>& a() const { return a_; }
  const std::optional<Source>& b() const { return b_; }
  // A as it was read; null before that.
  const PicturePtr& originalA() const { return originalA_; }
  // Whether both pictures of a frame are there, or cannot be read.
  bool ready(int frame) const;
  // Whether they are in the memory.
  bool cached(int frame) const;

  // Puts something between the pictures as they were read and the session, or takes it away (null): `show` gets them
  // from now on, those that are there at once. Playing waits while `busy`.
  void setStage(Show show, std::function<bool()> busy);
  // What was made of the file of A by that name comes as B; it stays with its frame.
  void setResult(const std::string& file, const QString& made, PicturePtr picture);

  // Files and patterns. What cannot be read is said, and what is on the screen stays.
  void open(const QString& path);
  // Where A is a sequence, so is B, at the same frame numbers. Opens A where there is none.
  void openB(const QString& path);
  void closeB();
  void swap();
  // Reads again what is on the screen, and looks for new frames of sequences.
  void reload();

 signals:
  // A or B is another one.
  void sourcesChanged();
  // The first picture of an A that was opened was read.
  void opened();

 private:
  struct Before {
    std::optional<Source> a, madeB;  // what was made of A
    std::vector<int> frames;
    int frame;
  };
  void setFrames(int frame);
  void sourcesAreNew();
  void want();
  void show();
  void pass();
  void readFailed(const std::string& path, const QString& reason);

  Session& session_;
  std::optional<Source> a_, b_;
  std::optional<Before> before_;  // until the first picture of A was read
  PicturePtr originalA_, originalB_;
  Show stage_;
  std::function<bool()> stageBusy_;
  Player player_;
  FrameCache cache_;
};

}  // namespace fathom::gui
