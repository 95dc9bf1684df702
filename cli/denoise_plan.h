// What is decided once for a whole sequence, so that frames do not differ in method: the inputs to use and the level of
// brightness.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "cli/base_denoiser.h"
#include "cli/denoise_setting.h"
#include "cli/frame_guide.h"
#include "cli/frame_source.h"
#include "cli/layers_frame.h"
#include "deep/denoise.h"

namespace fathom::cli {

struct SequencePlan {
  deep::DenoisePlan denoise;
  bool deep = true;            // the kind of all frames
  bool cameraSamples = false;  // they hold one deep sample per camera sample, which are clustered first
  // Denoises the frames, which are flat, instead of `denoise`; none: nothing does. It needs whole frames.
  std::optional<BaseDenoiser> base;
  std::optional<GuidePlan> guide;      // of deep frames
  std::optional<LayersPlan> layers;    // makes all of the output, from the frame's samples, instead of `denoise`
  bool errors = false;                 // error.{R,G,B} beside the colours; it needs whole frames
  std::optional<BudgetRecord> record;  // what a time budget chose, for the outputs to say
  std::set<std::string> notes;         // lines for the user
  // The main file that this was decided from; and where it is wanted and fits the memory, the image as it is denoised.
  std::string first;
  size_t pixels = 0, samples = 0;  // of that file
  std::optional<deep::DeepImage> firstImage;
};

// Decided from the first of the candidates that can be read whole; throws what the first one threw where none can.
// `wanted` is the main file of a frame that will be denoised next.
SequencePlan planSequence(const std::vector<FrameInputs>& candidates, const SourceOptions& options,
                          const deep::DenoiseParams& params, const std::string& wanted);

// For a plan that the layered network alone carries out: from the first of the candidates that can be opened. Camera
// samples are clustered first where the file tells how (the network errs less on bins), unless it is they that are
// coloured.
SequencePlan planLayered(const std::vector<FrameInputs>& candidates, const SourceOptions& options,
                         const LayersPlan& layers);

// Runs of the denoiser that a frame takes: one, and those that measure its errors where these are wanted and the filter
// does not tell them itself.
int runsOf(const SequencePlan& plan);

// Opens a frame as the plan has it: what is read, and whether it is clustered.
FrameSource openFrame(const FrameInputs& inputs, const SourceOptions& options, const SequencePlan& plan);

// An image of a source that openFrame gave, denoised as the plan has it. `guide`: of the whole frame, where the plan has
// one and the image is only a part of it.
deep::DeepImage denoiseAsPlanned(deep::DeepImage image, const FrameInputs& inputs, const SequencePlan& plan,
                                 const deep::BaseGuide* guide, const Progress& progress,
                                 deep::DenoiseStats* stats = nullptr);

// All of the plan that decides what comes out, as text to be hashed.
std::string describePlan(const SequencePlan& plan);

}  // namespace fathom::cli
