// The frames of a sequence through the denoiser: reading the next and writing the last overlap with the work on one.
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "cli/denoise_plan.h"
#include "cli/frame_sink.h"
#include "cli/frame_source.h"
#include "cli/progress_sink.h"

namespace fathom::cli {

struct DenoiseFrame {
  int number = 0;
  FrameInputs inputs;
  FrameOutputs outputs;
};

struct DenoiseJob {
  std::vector<DenoiseFrame> frames;
  SourceOptions source;
  SequencePlan plan;
  std::string settings;    // everything else that decides what comes out, as text to be hashed
  size_t memory = 0;       // bytes; frames that need more go through in bands of rows
  bool overlap = true;     // read and write beside the work
  bool claims = false;     // claim frames, as other processes may work on the same sequence
  bool overwrite = false;  // replace outputs that were made otherwise
  bool stats = false;      // reports keep what their frames took; over many frames, small pieces hold much of the heap
};

struct FrameReport {
  enum class Status { Done, Kept, Elsewhere, Failed };  // Elsewhere: another process makes it
  Status status = Status::Done;
  std::string error;         // one line
  deep::DenoiseStats stats;  // where the job asks for them: of the denoiser, and the seconds of "read" and "write"
  double seconds = 0;        // reading, denoising and writing together
  int bands = 0;
};

// One report per frame. A frame that fails leaves no output and does not stop the others. Throws Cancelled.
std::vector<FrameReport> denoiseSequence(DenoiseJob job, ProgressSink& display, const std::stop_token& stop);

}  // namespace fathom::cli
