// What is done with the frames that are open as jobs: denoising, and saving what is seen.
#pragma once

#include <QImage>
#include <QObject>
#include <QString>
#include <string>

#include "deep/clip_view.h"
#include "deep/denoise.h"
#include "gui/frames.h"
#include "gui/jobs.h"

namespace fathom::gui {

// A picture as the range leaves it, flattened: every plane that `flatten` makes. A flat picture passes as it is. Throws
// Error.
flat::Image flattenSeen(const Picture& picture, const deep::DepthRange& range);

class FrameJobs : public QObject {
  Q_OBJECT

 public:
  FrameJobs(Session& session, Frames& frames, Jobs& jobs, QObject* parent = nullptr);

  // Bytes that denoising may take.
  void setMemory(size_t bytes) { memory_ = bytes; }

  // The file of A, as `fathom denoise` does it; the result comes as B.
  void denoiseFrame(fathom::deep::Quality quality = deep::Quality::Balanced);
  // The frames of A from in to out, to files numbered as A is; they come as B. What is there already is kept where these
  // settings made it, and else a failure.
  void denoiseSequence(const QString& output, fathom::deep::Quality quality = deep::Quality::Balanced);
  // What is seen, within the clip range: flattened, or with its samples (hard planes only), as EXR.
  void saveFlattened(const QString& path);
  void saveDeep(const QString& path);
  // What `make` gives; it is called in another thread.
  void savePng(const QString& path, const std::function<QImage()>& make);

 private:
  bool canDenoise();
  void addSaving(const QString& path, const std::function<void(const std::string& path)>& write);
  bool isOpen(const QString& path);

  Session& session_;
  Frames& frames_;
  Jobs& jobs_;
  size_t memory_ = size_t(8) << 30;
};

}  // namespace fathom::gui
