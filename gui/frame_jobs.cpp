#include "gui/frame_jobs.h"

#include <QFileInfo>
#include <QSaveFile>

#include "base/error.h"
#include "cli/denoise_job.h"
#include "deep/clip.h"
#include "deep/flatten.h"
#include "deep/io.h"
#include "flat/io.h"

namespace fathom::gui {

namespace {

constexpr const char* kDenoised = "denoised";

// The frames of a sequence as one progress; what is told of them is kept for the end.
class SequenceProgress : public cli::ProgressSink {
 public:
  SequenceProgress(const Progress& progress, size_t frames) : progress_(progress), frames_(double(frames)) {}

  void at(double fraction) override { progress_.report((done_ + fraction) / frames_); }
  void frameDone(const std::string&) override {
    ++done_;
    at(0);
  }
  void tell(const std::string&) override {}

 private:
  const Progress& progress_;
  const double frames_;
  double done_ = 0;
};

cli::DenoiseRequest requestOf(const Source& source, deep::Quality quality, size_t memory) {
  cli::DenoiseRequest request;
  request.input = source.pattern.text();
  request.params.quality = quality;
  request.memory = memory;
  return request;
}

QString describeReports(const std::vector<cli::FrameReport>& reports) {
  using Status = cli::FrameReport::Status;
  int kept = 0, elsewhere = 0, failed = 0;
  std::string error;
  for (const cli::FrameReport& report : reports) {
    kept += report.status == Status::Kept;
    elsewhere += report.status == Status::Elsewhere;
    failed += report.status == Status::Failed;
    if (error.empty()) error = report.error;
  }
  std::string line =
      fmt::format("{} of {} frames denoised", int(reports.size()) - kept - elsewhere - failed, reports.size());
  if (kept > 0) line += fmt::format(", {} were done before", kept);
  if (elsewhere > 0) line += fmt::format(", {} are made by another process", elsewhere);
  if (failed > 0) line += fmt::format(", {} failed: {}", failed, error);
  return QString::fromStdString(line);
}

void checkHard(const deep::DepthRange& range) {
  if (range.soft > 0 || range.inverted)
    fail("saving samples: expected a range with hard ends, found {} one", range.inverted ? "an inverted" : "a soft");
}

QString fileName(const std::string& path) {
  return QFileInfo(QString::fromStdString(path)).fileName();
}

}  // namespace

flat::Image flattenSeen(const Picture& picture, const deep::DepthRange& range) {
  if (picture.flat()) return picture.flat()->copy();
  const deep::DeepImage& image = *picture.deep();
  if (range.isAll()) return deep::flatten(image);
  if (range.soft == 0 && !range.inverted) return deep::flatten(deep::clip(image, range.near, range.far));
  // The planes that flattening makes, from no rows at all.
  flat::Image result = deep::flatten(deep::rows(image, image.dataWindow.y0, image.dataWindow.y0));
  std::vector<std::string> channels;
  for (const flat::Plane& plane : result.planes)
    if (plane.name != "A") channels.push_back(plane.name);
  result.planes = std::move(deep::clipView(image, image.dataWindow, 1, range, channels).planes);
  result.dataWindow = image.dataWindow;
  return result;
}

FrameJobs::FrameJobs(Session& session, Frames& frames, Jobs& jobs, QObject* parent)
    : QObject(parent), session_(session), frames_(frames), jobs_(jobs) {
  connect(&jobs_, &Jobs::failed, &session_, [this](const QString&, const QString& line) { session_.say(line); });
  connect(&jobs_, &Jobs::cancelled, &session_,
          [this](const QString& name) { session_.say(tr("%1: stopped").arg(name)); });
}

bool FrameJobs::canDenoise() {
  const bool can = frames_.a() && frames_.a()->made.isEmpty() && frames_.originalA();
  if (!can) session_.say(tr("Open a noisy render as A to denoise it"));
  return can;
}

void FrameJobs::denoiseFrame(deep::Quality quality) {
  if (!canDenoise()) return;
  const Source& source = *frames_.a();
  const int frame = frames_.player().frame();
  const std::string file = source.at(frame);
  const auto work = [this, file, frame, request = requestOf(source, quality, memory_),
                     sequence = cli::Sequence{source.pattern, source.frames, {}}](const Progress& progress) {
    const PicturePtr result =
        makePicture(file + " (" + kDenoised + ")", cli::denoiseFrame(request, sequence, frame, progress));
    return std::function<void()>([this, file, result] {
      frames_.setResult(file, kDenoised, result);
      session_.say(tr("%1 is denoised: B shows it").arg(fileName(file)));
    });
  };
  jobs_.add({"denoise frame", tr("Denoising %1").arg(fileName(file)), work});
}

void FrameJobs::denoiseSequence(const QString& output, deep::Quality quality) {
  if (!canDenoise()) return;
  const Source& source = *frames_.a();
  cli::DenoiseRequest request = requestOf(source, quality, memory_);
  request.output = output.toStdString();
  cli::Sequence sequence{source.pattern, source.frames, {}};
  if (source.isSequence())  // and so that whose frames are played
    std::erase_if(sequence.frames, [&player = frames_.player()](int f) { return f < player.in() || f > player.out(); });
  const auto work = [this, request, sequence, output](const Progress& progress) {
    SequenceProgress frames(progress, sequence.frames.size());
    const auto reports = cli::denoiseSequence(cli::makeDenoiseJob(request, sequence, true), frames, progress.stop);
    return std::function<void()>([this, input = request.input, output, line = describeReports(reports)] {
      if (frames_.a() && frames_.a()->made.isEmpty() && frames_.a()->pattern.text() == input) frames_.openB(output);
      session_.say(line);
    });
  };
  jobs_.add({"denoise sequence", tr("Denoising %n frames", nullptr, int(sequence.frames.size())), work});
}

// Writing over what is looked at would change it.
bool FrameJobs::isOpen(const QString& path) {
  for (const PicturePtr& picture : {session_.a(), session_.b()})
    if (picture && QFileInfo(QString::fromStdString(picture->path)) == QFileInfo(path)) {
      session_.say(tr("%1: expected another file than one that is open").arg(path));
      return true;
    }
  return false;
}

void FrameJobs::addSaving(const QString& path, const std::function<void(const std::string&)>& write) {
  if (isOpen(path)) return;
  const auto work = [this, path, write](const Progress& progress) {
    progress.at(0);
    write(path.toStdString());
    return std::function<void()>([this, path] { session_.say(tr("Saved %1").arg(path)); });
  };
  jobs_.add({"save " + path, tr("Saving %1").arg(QFileInfo(path).fileName()), work});
}

void FrameJobs::saveFlattened(const QString& path) {
  const PicturePtr picture = session_.seen();
  if (!picture) return;
  addSaving(path, [picture, range = session_.view().clip](const std::string& to) {
    flat::write(to, flattenSeen(*picture, range));
  });
}

void FrameJobs::saveDeep(const QString& path) {
  const PicturePtr picture = session_.seen();
  if (!picture) return;
  addSaving(path, [picture, range = session_.view().clip](const std::string& to) {
    if (!picture->deep()) fail("{}: expected a deep image to save its samples, found a flat one", picture->path);
    checkHard(range);
    if (range.isAll())
      deep::write(to, *picture->deep());
    else
      deep::write(to, deep::clip(*picture->deep(), range.near, range.far));
  });
}

void FrameJobs::savePng(const QString& path, const std::function<QImage()>& make) {
  addSaving(path, [make](const std::string& to) {
    const QImage image = make();
    if (image.isNull()) fail("{}: expected pixels to save, found an empty data window", to);
    QSaveFile file(QString::fromStdString(to));
    if (!file.open(QIODevice::WriteOnly) || !image.save(&file, "PNG") || !file.commit())
      fail("{}: expected a file that can be written, found: {}", to, oneLine(file.errorString().toStdString()));
  });
}

}  // namespace fathom::gui
