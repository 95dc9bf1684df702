// The passes of a growing render, each mixed with its denoised self.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "cli/base_denoiser.h"
#include "cli/progress_sink.h"
#include "cli/sequence.h"
#include "deep/denoise.h"
#include "flat/denoiser.h"
#include "flat/error_summary.h"

namespace fathom::cli {

// Files are names or patterns, numbered as the input is; empty: none. The options of `fathom progressive`.
struct ProgressiveRequest {
  std::string input, output;
  std::string features;
  std::vector<std::string> halves;  // none or two
  std::string map;
  BaseOptions base;
  deep::Quality quality = deep::Quality::Balanced;
  int probes = 0;          // 0: none where the base tells its error by itself, else as many as flat::SureParams has
  std::string candidates;  // where what is mixed goes, with its estimates
  bool errors = false;     // error.{R,G,B} in the outputs
  bool estimates = false;  // wanted even of outputs that are done
  bool overwrite = false;
  size_t memory = size_t(8) << 30;
};

// What became of one file.
struct PassReport {
  enum class Status { Done, Kept, Elsewhere, Failed };  // Elsewhere: another process makes it
  Status status = Status::Done;
  int pass = 0;  // its number
  std::string input, output;
  std::string error;  // one line, where it failed
  int spp = 0;        // 0: the file does not tell
  double seconds = 0;
  flat::ErrorSummary errors;  // empty where it was kept
};

// One report per file, in the sequence's order. `done` hears of each when it is done: what another process makes comes
// again behind all others. A file that fails leaves no output and does not
// stop the others. Throws Error and CLI::ValidationError where the request cannot be met, and Cancelled.
std::vector<PassReport> runProgressive(const ProgressiveRequest& request, const Sequence& sequence,
                                       ProgressSink& display, const std::stop_token& stop,
                                       const std::function<void(const PassReport&)>& done);

}  // namespace fathom::cli
