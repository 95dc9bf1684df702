// The work on a sequence in pieces: a chunk is a frame, or a band of its rows where the frame does not fit the memory.
// Bands overlap by the rows that decide a result, so that the bits do not depend on them.
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "cli/claim.h"
#include "cli/denoise_bands.h"
#include "cli/denoise_sequence.h"

namespace fathom::cli {

struct Chunk {
  size_t frame = 0;
  std::shared_ptr<const FrameOrigin> origin;
  Band band{0, 0};
  bool last = true;                              // of its frame
  std::shared_ptr<const deep::BaseGuide> guide;  // of the whole frame, where a band needs it
  std::shared_ptr<LayersFrame> layers;           // reads the band itself, where the plan has it
  deep::DeepImage image;               // the band with the rows around it that decide it; then the band denoised
  bool kept = false;                   // nothing to do: the outputs are there
  bool elsewhere = false;              // nothing to do: another process makes them
  std::shared_ptr<const Claim> claim;  // on the frame, until it is written
  std::string error;                   // one line; empty: none
  double seconds = 0;                  // of the stage that it comes from
  std::set<std::string> notes;         // lines for the user
};

// The error that is being handled, in one line that begins with a file of the frame.
std::string describeError(const DenoiseFrame& frame);

// The first stage: looks what is there already, and reads.
class ChunkReader {
 public:
  explicit ChunkReader(DenoiseJob& job);

  // The next chunk, or nothing after the last one. A frame that cannot be read is one chunk with an error. Frames that
  // other processes make are looked at again behind all others.
  std::optional<Chunk> next();

 private:
  enum class Opening { Ready, Done, Elsewhere };

  Opening open();
  bool isDone(const FrameOutputs& outputs, const std::string& madeBy) const;
  deep::DeepImage read(std::set<std::string>& notes);
  void openLayers(const DenoiseFrame& frame, const std::string& madeBy);
  void close();

  DenoiseJob& job_;
  const int halo_;
  std::vector<size_t> order_;  // of the frames
  size_t next_ = 0, band_ = 0;
  std::shared_ptr<const Claim> claim_;
  std::optional<FrameSource> source_;
  std::vector<Band> bands_;
  std::shared_ptr<const FrameOrigin> origin_;
  std::shared_ptr<const deep::BaseGuide> guide_;
  std::shared_ptr<LayersFrame> layers_;
};

// The last stage.
class ChunkWriter {
 public:
  explicit ChunkWriter(const DenoiseJob& job) : job_(job) {}

  // Returns the chunk without its image, with an error where it could not be written.
  Chunk write(Chunk chunk);
  // Forgets a frame that is not complete.
  void drop() { sink_.reset(); }

 private:
  const DenoiseJob& job_;
  std::optional<FrameSink> sink_;
};

}  // namespace fathom::cli
