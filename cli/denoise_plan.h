// What is decided once for a whole sequence, so that frames do not differ in method: the inputs to use and the level of
// brightness.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "cli/frame_source.h"
#include "deep/denoise.h"

namespace fathom::cli {

struct SequencePlan {
  deep::DenoisePlan denoise;
  bool deep = true;             // the kind of all frames
  std::set<std::string> notes;  // lines for the user
};

// Which channels of the main file are read: what the denoiser uses, and what is carried to the output.
bool isWanted(const deep::DenoisePlan& plan, const std::string& channel);

// Decided from the first of the candidates that can be read whole; throws what the first one threw where none can.
SequencePlan planSequence(const std::vector<FrameInputs>& candidates, const SourceOptions& options,
                          const deep::DenoiseParams& params);

// All of the plan that decides what comes out, as text to be hashed.
std::string describePlan(const deep::DenoisePlan& plan);

}  // namespace fathom::cli
