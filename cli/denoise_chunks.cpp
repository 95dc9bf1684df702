#include "cli/denoise_chunks.h"

#include <fmt/format.h>

#include <algorithm>
#include <new>
#include <numeric>

#include "base/error.h"
#include "cli/content_hash.h"
#include "cli/stopwatch.h"

namespace fathom::cli {

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

ChunkReader::ChunkReader(DenoiseJob& job)
    : job_(job), halo_(deep::denoiseHalo(job.plan.denoise)), order_(job.frames.size()) {
  std::iota(order_.begin(), order_.end(), size_t(0));
}

std::optional<Chunk> ChunkReader::next() {
  const Stopwatch watch;
  Chunk chunk;
  try {
    Opening opening = Opening::Ready;
    while (!source_ && !layers_) {
      if (next_ == order_.size()) return {};
      chunk.frame = order_[next_];
      opening = open();
      if (opening != Opening::Elsewhere || next_ >= job_.frames.size()) break;
      order_.push_back(order_[next_++]);
    }
    chunk.frame = order_[next_];
    chunk.kept = opening == Opening::Done;
    chunk.elsewhere = opening == Opening::Elsewhere;
    if (opening == Opening::Ready) {
      chunk.origin = origin_;
      chunk.guide = guide_;
      chunk.claim = claim_;
      chunk.band = bands_[band_];
      chunk.layers = layers_;
      if (layers_)
        chunk.notes = layers_->notes();
      else
        chunk.image = read(chunk.notes);
      chunk.last = ++band_ == bands_.size();
    }
  } catch (const std::exception&) {
    chunk.error = describeError(job_.frames[chunk.frame]);
    chunk.last = true;
  }
  if (chunk.last) close();
  chunk.seconds = watch.seconds();
  return chunk;
}

ChunkReader::Opening ChunkReader::open() {
  const DenoiseFrame& frame = job_.frames[order_[next_]];
  ContentHash hash;
  for (const std::string& text : {std::string(FATHOM_VERSION), job_.settings, describePlan(job_.plan)}) hash.add(text);
  for (const std::string& file : frame.inputs.files()) hash.addFile(file);
  const std::string madeBy = fmt::format("fathom {} {:016x}", FATHOM_VERSION, hash.value());
  if (isDone(frame.outputs, madeBy)) {
    Claim::clear(frame.outputs.files());
    return Opening::Done;
  }
  if (job_.claims) {
    claim_ = Claim::take(frame.outputs.files());
    if (!claim_) return Opening::Elsewhere;
    if (isDone(frame.outputs, madeBy)) return Opening::Done;
  }
  if (job_.plan.layers) {
    openLayers(frame, madeBy);
    return Opening::Ready;
  }
  source_.emplace(openFrame(frame.inputs, job_.source, job_.plan));
  bands_ = planBands(*source_, job_.plan, halo_, job_.memory);
  if (bands_.size() > 1) job_.plan.firstImage.reset();
  if (job_.plan.guide && job_.plan.guide->wholeFrame && bands_.size() > 1)
    guide_ = std::make_shared<deep::BaseGuide>(
        readGuide(*source_, bands_.front().y1 - bands_.front().y0, *job_.plan.guide, frame.inputs, job_.plan.denoise));
  origin_ = std::make_shared<FrameOrigin>(FrameOrigin{frame.inputs.main, source_->deep(), source_->part().number,
                                                      source_->part().dataWindow, source_->flatAttributes(), madeBy,
                                                      job_.plan.record});
  return Opening::Ready;
}

void ChunkReader::openLayers(const DenoiseFrame& frame, const std::string& madeBy) {
  layers_ = std::make_shared<LayersFrame>(*job_.plan.layers, frame.inputs, job_.source, job_.plan.cameraSamples);
  bands_ = layers_->bands();
  const deep::PartInfo& part = layers_->source().part();
  origin_ = std::make_shared<FrameOrigin>(FrameOrigin{.path = frame.inputs.main,
                                                      .part = part.number,
                                                      .dataWindow = part.dataWindow,
                                                      .flatAttributes = {},
                                                      .madeBy = madeBy,
                                                      .record = {},
                                                      .flattened = job_.plan.layers->output == LayersOutput::Flat});
}

bool ChunkReader::isDone(const FrameOutputs& outputs, const std::string& madeBy) const {
  bool done = true;
  for (const std::string& file : outputs.files()) {
    const Standing standing = standingOf(file, kMadeBy, madeBy);
    if (standing == Standing::Other && !job_.overwrite)
      fail(
          "{}: expected nothing there, or what these settings make of this input; found another file (--overwrite "
          "replaces it)",
          file);
    done = done && standing == Standing::Ours;
  }
  return done;
}

deep::DeepImage ChunkReader::read(std::set<std::string>& notes) {
  if (bands_.size() == 1 && job_.plan.firstImage && job_.plan.first == source_->path())
    return *std::exchange(job_.plan.firstImage, std::nullopt);
  const Box& window = source_->part().dataWindow;
  const Band& band = bands_[band_];
  return source_->read(std::max(band.y0 - halo_, window.y0), std::min(band.y1 + halo_, window.y1), notes);
}

void ChunkReader::close() {
  source_.reset();
  guide_.reset();
  layers_.reset();
  bands_.clear();
  claim_.reset();
  band_ = 0;
  ++next_;
}

Chunk ChunkWriter::write(Chunk chunk) {
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

}  // namespace fathom::cli
