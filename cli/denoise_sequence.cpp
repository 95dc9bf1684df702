// Three stages, one chunk in each: while one is denoised, the next is read and the last is written.
#include "cli/denoise_sequence.h"

#include <fmt/format.h>

#include <algorithm>
#include <future>
#include <optional>
#include <set>

#include "base/error.h"
#include "base/progress.h"
#include "base/worker.h"
#include "cli/denoise_chunks.h"
#include "cli/stopwatch.h"
#include "deep/flat_nl_means.h"

namespace fathom::cli {

namespace {

// The stages together, and what is told of them.
class SequenceRun {
 public:
  SequenceRun(DenoiseJob job, ProgressSink& display, const std::stop_token& stop)
      : job_(std::move(job)),
        display_(display),
        stop_(stop),
        reader_(job_),
        writer_(job_),
        reports_(job_.frames.size()),
        told_(job_.plan.notes) {}

  std::vector<FrameReport> run() {
    std::future<std::optional<Chunk>> reading = read();
    while (std::optional<Chunk> chunk = reading.get()) {
      if (stop_.stop_requested()) throw Cancelled();
      reading = read();
      if (!process(*chunk)) continue;
      finishWriting();
      if (!reports_[chunk->frame].error.empty()) continue;  // an earlier band could not be written
      writing_ =
          start(writingThread_, [this, work = std::move(*chunk)]() mutable { return writer_.write(std::move(work)); });
      if (!job_.overlap) finishWriting();
    }
    finishWriting();
    return std::move(reports_);
  }

 private:
  // Calls `work` in the thread of a stage, or, where stages do not overlap, when its result is asked for.
  template <class Work>
  std::future<std::invoke_result_t<Work&>> start(std::optional<Worker>& stage, Work work) {
    if (!job_.overlap) return std::async(std::launch::deferred, std::move(work));
    if (!stage) stage.emplace();
    return stage->result(std::move(work));
  }

  std::future<std::optional<Chunk>> read() {
    return start(readingThread_, [this] { return reader_.next(); });
  }

  // True where the chunk goes on to be written.
  bool process(Chunk& chunk) {
    FrameReport& report = reports_[chunk.frame];
    for (const std::string& note : chunk.notes)
      if (told_.insert(note).second) display_.tell(note);
    if (!report.error.empty()) return false;  // an earlier band failed
    report.stats.seconds["read"] += chunk.seconds;
    report.seconds += chunk.seconds;
    ++report.bands;
    if (chunk.error.empty() && !chunk.kept && !chunk.elsewhere) denoise(chunk, report);
    if (chunk.kept) {
      report.status = FrameReport::Status::Kept;
      ended(report, fmt::format("{}: done before", job_.frames[chunk.frame].outputs.image));
    } else if (chunk.elsewhere) {
      report.status = FrameReport::Status::Elsewhere;
      ended(report, fmt::format("{}: another process is at it", job_.frames[chunk.frame].outputs.image));
    } else if (!chunk.error.empty()) {
      finishWriting();  // an earlier band of the same frame may be in it
      writer_.drop();
      failed(chunk);
    }
    return !chunk.kept && !chunk.elsewhere && report.error.empty();
  }

  void denoise(Chunk& chunk, FrameReport& report) {
    const Box& window = chunk.origin->dataWindow;
    const double height = std::max(1, window.height());
    const Progress progress{
        [&](double done) {
          display_.at((chunk.band.y0 - window.y0 + done * (chunk.band.y1 - chunk.band.y0)) / height);
        },
        stop_};
    const Stopwatch watch;
    try {
      if (chunk.layers) {
        chunk.image = chunk.layers->denoise(chunk.band, progress, &report.stats);
        report.seconds += watch.seconds();
        return;
      }
      chunk.image = denoiseAsPlanned(std::move(chunk.image), job_.frames[chunk.frame].inputs, job_.plan,
                                     chunk.guide.get(), progress, &report.stats);
      const Box& around = chunk.image.dataWindow;
      if (around.y0 != chunk.band.y0 || around.y1 != chunk.band.y1)
        chunk.image = deep::rows(chunk.image, chunk.band.y0, chunk.band.y1);
    } catch (const Cancelled&) {
      throw;
    } catch (const std::exception&) {
      chunk.error = describeError(job_.frames[chunk.frame]);
    }
    report.seconds += watch.seconds();
  }

  void finishWriting() {
    if (!writing_.valid()) return;
    const Chunk chunk = writing_.get();
    FrameReport& report = reports_[chunk.frame];
    report.stats.seconds["write"] += chunk.seconds;
    report.seconds += chunk.seconds;
    if (!chunk.error.empty()) return failed(chunk);
    if (!chunk.last) return;
    if (const auto found = report.stats.counts.find("non-finite samples");
        found != report.stats.counts.end() && found->second > 0)
      display_.tell(fmt::format("{}: {} samples without a finite colour got the filtered one",
                                job_.frames[chunk.frame].inputs.main, found->second));
    ended(report, fmt::format("{}: {:.1f} s", job_.frames[chunk.frame].outputs.image, report.seconds));
  }

  void failed(const Chunk& chunk) {
    reports_[chunk.frame].status = FrameReport::Status::Failed;
    reports_[chunk.frame].error = chunk.error;
    display_.tell("fathom: " + chunk.error);
    ended(reports_[chunk.frame], "");
  }

  void ended(FrameReport& report, const std::string& line) {
    if (!job_.stats) report.stats = {};
    display_.frameDone(line);
  }

  DenoiseJob job_;
  ProgressSink& display_;
  const std::stop_token stop_;
  ChunkReader reader_;
  ChunkWriter writer_;
  std::vector<FrameReport> reports_;
  std::set<std::string> told_;
  std::future<Chunk> writing_;
  std::optional<Worker> readingThread_, writingThread_;  // last: their destructors wait for the stages
};

}  // namespace

std::vector<FrameReport> denoiseSequence(DenoiseJob job, ProgressSink& display, const std::stop_token& stop) {
  return SequenceRun(std::move(job), display, stop).run();
}

}  // namespace fathom::cli
