// Three stages, one chunk in each: a chunk is a frame, or a band of its rows where the frame does not fit the memory.
// Bands overlap by the rows that decide a result, so that the bits do not depend on them.
#include "cli/denoise_sequence.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <future>
#include <new>
#include <optional>
#include <set>

#include "cli/content_hash.h"
#include "flat/error.h"
#include "flat/progress.h"

namespace fathom::cli {

namespace {

class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// What went wrong, in one line that begins with a file.
std::string describeError(const DenoiseFrame& frame) {
  std::vector<std::string> files = frame.inputs.files();
  for (const std::string& file : frame.outputs.files()) files.push_back(file);
  try {
    throw;
  } catch (const Error& e) {
    return namingFile(e.what(), files);
  } catch (const std::bad_alloc&) {
    return namingFile("out of memory", files);
  } catch (const std::exception& e) {
    return namingFile(oneLine(e.what()), files);
  }
}

struct Band {
  int y0, y1;
};

struct Chunk {
  size_t frame = 0;
  std::shared_ptr<const FrameOrigin> origin;
  Band band{0, 0};
  bool last = true;       // of its frame
  deep::DeepImage image;  // the band with the rows around it that decide it; then the band denoised
  bool kept = false;      // nothing to do: the outputs are there
  std::string error;      // the frame cannot be read
  double seconds = 0;     // of the stage that it comes from
  std::set<std::string> notes;
};

// As few bands of as many rows each as that they, with `halo` more rows on both sides, take at most `budget` bytes.
std::vector<Band> cutBands(FrameSource& source, int halo, size_t budget) {
  const Box& window = source.part().dataWindow;
  if (source.decodedBytes(window.y0, window.y1) <= budget) return {{window.y0, window.y1}};
  std::vector<size_t> upTo = {0};
  for (int y = window.y0; y < window.y1; ++y) upTo.push_back(upTo.back() + source.decodedBytes(y, y + 1));
  const auto bytes = [&](const Band& band) {
    return upTo[size_t(std::min(band.y1 + halo, window.y1) - window.y0)] -
           upTo[size_t(std::max(band.y0 - halo, window.y0) - window.y0)];
  };
  size_t most = 0;
  for (int height = (window.height() + 1) / 2;; height = (height + 1) / 2) {
    std::vector<Band> bands;
    most = 0;
    for (int y = window.y0; y < window.y1; y += height) {
      bands.push_back({y, std::min(y + height, window.y1)});
      most = std::max(most, bytes(bands.back()));
    }
    if (most <= budget) return bands;
    if (height == 1) break;
  }
  fail("{}: expected at least {} MB of memory, for a row with the {} around it that decide it; found a limit of {} MB",
       source.path(), memoryFor(most) / 1'000'000 + 1, 2 * halo, memoryFor(budget) / 1'000'000);
}

// The first stage: checks what is there already, and reads.
class ChunkReader {
 public:
  explicit ChunkReader(DenoiseJob& job) : job_(job), halo_(deep::denoiseHalo(job.plan.denoise)) {}

  // The next chunk, or nothing after the last one.
  std::optional<Chunk> next() {
    const Stopwatch watch;
    if (!source_ && frame_ == job_.frames.size()) return {};
    Chunk chunk;
    chunk.frame = frame_;
    try {
      if (!source_ && !open()) {
        chunk.kept = true;
      } else {
        const Box& window = source_->part().dataWindow;
        chunk.origin = origin_;
        chunk.band = bands_[band_++];
        if (bands_.size() == 1 && job_.plan.firstImage && job_.plan.first == source_->path())
          chunk.image = *std::exchange(job_.plan.firstImage, std::nullopt);
        else
          chunk.image = source_->read(std::max(chunk.band.y0 - halo_, window.y0),
                                      std::min(chunk.band.y1 + halo_, window.y1), chunk.notes);
        chunk.last = band_ == bands_.size();
      }
    } catch (const std::exception&) {
      chunk.error = describeError(job_.frames[frame_]);
      chunk.last = true;
    }
    if (chunk.last) close();
    chunk.seconds = watch.seconds();
    return chunk;
  }

 private:
  // False where the outputs are there already.
  bool open() {
    const DenoiseFrame& frame = job_.frames[frame_];
    ContentHash hash;
    for (const std::string& text : {std::string(FATHOM_VERSION), job_.settings, describePlan(job_.plan)})
      hash.add(text);
    for (const std::string& file : frame.inputs.files()) hash.addFile(file);
    const std::string madeBy = fmt::format("fathom {} {:016x}", FATHOM_VERSION, hash.value());
    if (isDone(frame.outputs, madeBy)) return false;

    source_.emplace(openFrame(frame.inputs, job_.source, job_.plan));
    bands_ = cutBands(*source_, halo_, decodedLimit(job_.memory));
    origin_ = std::make_shared<FrameOrigin>(FrameOrigin{frame.inputs.main, source_->deep(), source_->part().number,
                                                        source_->part().dataWindow, source_->flatAttributes(), madeBy});
    return true;
  }

  bool isDone(const FrameOutputs& outputs, const std::string& madeBy) const {
    bool done = true;
    for (const std::string& file : outputs.files()) {
      const Standing standing = standingOf(file, madeBy);
      if (standing == Standing::Other && !job_.overwrite)
        fail(
            "{}: expected nothing there, or what these settings make of this input; found another file (--overwrite "
            "replaces it)",
            file);
      done = done && standing == Standing::Ours;
    }
    return done;
  }

  void close() {
    source_.reset();
    bands_.clear();
    band_ = 0;
    ++frame_;
  }

  DenoiseJob& job_;
  const int halo_;
  size_t frame_ = 0, band_ = 0;
  std::optional<FrameSource> source_;
  std::vector<Band> bands_;
  std::shared_ptr<const FrameOrigin> origin_;
};

// The last stage. Returns the chunk without its image.
class ChunkWriter {
 public:
  explicit ChunkWriter(const DenoiseJob& job) : job_(job) {}

  Chunk write(Chunk chunk) {
    const Stopwatch watch;
    try {
      if (!sink_) sink_.emplace(job_.frames[chunk.frame].outputs, *chunk.origin);
      sink_->write(std::move(chunk.image));
      if (chunk.last) sink_->finish();
    } catch (const std::exception&) {
      chunk.error = describeError(job_.frames[chunk.frame]);
    }
    if (chunk.last || !chunk.error.empty()) drop();
    chunk.image = {};
    chunk.seconds = watch.seconds();
    return chunk;
  }

  // Forgets a frame that is not complete.
  void drop() { sink_.reset(); }

 private:
  const DenoiseJob& job_;
  std::optional<FrameSink> sink_;
};

// The stages together, and what is told of them.
class SequenceRun {
 public:
  SequenceRun(DenoiseJob job, ProgressDisplay& display, const std::stop_token& stop)
      : job_(std::move(job)),
        display_(display),
        stop_(stop),
        reader_(job_),
        writer_(job_),
        reports_(job_.frames.size()),
        told_(job_.plan.notes) {}

  std::vector<FrameReport> run() {
    const std::launch launch = job_.overlap ? std::launch::async : std::launch::deferred;
    std::future<std::optional<Chunk>> reading = std::async(launch, [this] { return reader_.next(); });
    while (std::optional<Chunk> chunk = reading.get()) {
      if (stop_.stop_requested()) throw Cancelled();
      reading = std::async(launch, [this] { return reader_.next(); });
      if (!process(*chunk)) continue;
      finishWriting();
      if (!reports_[chunk->frame].error.empty()) continue;  // an earlier band could not be written
      writing_ =
          std::async(launch, [this, work = std::move(*chunk)]() mutable { return writer_.write(std::move(work)); });
      if (!job_.overlap) finishWriting();
    }
    finishWriting();
    return std::move(reports_);
  }

 private:
  // True where the chunk goes on to be written.
  bool process(Chunk& chunk) {
    FrameReport& report = reports_[chunk.frame];
    for (const std::string& note : chunk.notes)
      if (told_.insert(note).second) display_.tell(note);
    if (!report.error.empty()) return false;  // an earlier band failed
    report.stats.seconds["read"] += chunk.seconds;
    ++report.bands;
    if (chunk.error.empty() && !chunk.kept) denoise(chunk, report);
    if (chunk.kept) {
      report.status = FrameReport::Status::Kept;
      display_.frameDone(fmt::format("{}: done before", job_.frames[chunk.frame].outputs.image));
    } else if (!chunk.error.empty()) {
      finishWriting();  // an earlier band of the same frame may be in it
      writer_.drop();
      failed(chunk);
    }
    return !chunk.kept && report.error.empty();
  }

  void denoise(Chunk& chunk, FrameReport& report) {
    const Box& window = chunk.origin->dataWindow;
    const double height = std::max(1, window.height());
    const Progress progress{
        [&](double done) {
          display_.at((chunk.band.y0 - window.y0 + done * (chunk.band.y1 - chunk.band.y0)) / height);
        },
        stop_};
    try {
      chunk.image = deep::denoise(std::move(chunk.image), job_.plan.denoise, progress, &report.stats);
      const Box& around = chunk.image.dataWindow;
      if (around.y0 != chunk.band.y0 || around.y1 != chunk.band.y1)
        chunk.image = deep::rows(chunk.image, chunk.band.y0, chunk.band.y1);
    } catch (const Cancelled&) {
      throw;
    } catch (const std::exception&) {
      chunk.error = describeError(job_.frames[chunk.frame]);
    }
  }

  void finishWriting() {
    if (!writing_.valid()) return;
    const Chunk chunk = writing_.get();
    FrameReport& report = reports_[chunk.frame];
    report.stats.seconds["write"] += chunk.seconds;
    if (!chunk.error.empty()) return failed(chunk);
    if (!chunk.last) return;
    double seconds = 0;
    for (const auto& [stage, time] : report.stats.seconds) seconds += time;
    if (const auto found = report.stats.counts.find("non-finite samples");
        found != report.stats.counts.end() && found->second > 0)
      display_.tell(fmt::format("{}: {} samples without a finite colour got the filtered one",
                                job_.frames[chunk.frame].inputs.main, found->second));
    display_.frameDone(fmt::format("{}: {:.1f} s", job_.frames[chunk.frame].outputs.image, seconds));
  }

  void failed(const Chunk& chunk) {
    reports_[chunk.frame].status = FrameReport::Status::Failed;
    reports_[chunk.frame].error = chunk.error;
    display_.tell("fathom: " + chunk.error);
    display_.frameDone("");
  }

  DenoiseJob job_;
  ProgressDisplay& display_;
  const std::stop_token stop_;
  ChunkReader reader_;
  ChunkWriter writer_;
  std::vector<FrameReport> reports_;
  std::set<std::string> told_;
  std::future<Chunk> writing_;  // last: its destructor waits for the writer
};

}  // namespace

std::vector<FrameReport> denoiseSequence(DenoiseJob job, ProgressDisplay& display, const std::stop_token& stop) {
  return SequenceRun(std::move(job), display, stop).run();
}

}  // namespace fathom::cli
