// What is asked of the denoiser, by a command line or a window, made into the work on a sequence.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "cli/base_denoiser.h"
#include "cli/denoise_sequence.h"
#include "cli/load_image.h"
#include "cli/sequence.h"

namespace fathom::cli {

// Files are names or patterns, numbered as the input is; empty: none. The options of `fathom denoise`.
struct DenoiseRequest {
  std::string input, output, flattened;
  std::string features, alpha;
  std::string guide = "auto";       // or nlm, neural, oidn, layers, none, a file: see planGuide
  std::vector<std::string> halves;  // none or two
  std::string map, part;
  deep::DenoiseParams params;
  BaseOptions base;
  LayersOptions layers;  // of --method layers
  // Seconds a frame, for its denoising: chooses the quality, and what else is left open, in the place of `params` (see
  // cli/denoise_budget).
  std::optional<double> timeBudget;
  bool anyBase = false;  // the budget may choose the base of flat frames, too
  bool split = false;    // diffuse and specular also in files of their own
  bool errors = false;   // error.{R,G,B} beside the colours
  bool overwrite = false;
  size_t memory = size_t(8) << 30;
};

// Whether a choice of guide is a file's name.
bool isGuideFile(const std::string& guide);

// The guide that is asked for: --method says it, too.
std::string guideChoice(const DenoiseRequest& request);

// The frames of `sequence`, which is that of the input, or a part of it. The plan comes from the first frame on disk,
// whether it is among them or not. Throws Error, and CLI::ValidationError where outputs are named in a way that cannot
// be.
DenoiseJob makeDenoiseJob(const DenoiseRequest& request, const Sequence& sequence, bool overlap);

// One frame denoised in memory, as the job would write it; outputs are not looked at. Throws Error and Cancelled.
AnyImage denoiseFrame(const DenoiseRequest& request, const Sequence& sequence, int frame, const Progress& progress);

}  // namespace fathom::cli
