// What guides the bins of deep frames: --flat-guide, decided once per sequence and made for every frame.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/base_denoiser.h"
#include "cli/frame_source.h"
#include "deep/base_guide.h"

namespace fathom::cli {

struct GuidePlan {
  deep::GuideDenoisers denoisers;  // none: FrameInputs::guide is a file that is denoised already
  bool wholeFrame = true;          // else a band of rows can be guided by what is made of that band
  std::string settings;            // all that decides what it makes, as text to be hashed
  BytesOf bytes = {};              // that its library or network takes beside it
  // Makes the flattened frame from the frame's files, where that is not done by `denoisers`: from samples.
  std::function<flat::Image(const FrameInputs&, const Progress&)> flattened = {};
};

// Bytes that a guide takes: of each pixel while it is made, and of each that is kept for bands of the frame; and its library
// or network.
struct GuideBytes {
  size_t madePerPixel = 0, keptPerPixel = 0, library = 0;
};
// For a frame, or a band where those are guided, of so many pixels, in a run that may take `memory` bytes.
GuideBytes guideBytes(const GuidePlan& guide, size_t pixels, size_t memory);

// Whether frames that offer this say enough of their noise to be guided.
bool canBeGuided(const deep::DenoiseInputs& inputs);

// Whether a guide of whole frames leaves memory for a frame of so many pixels itself, in a run that may take `memory` bytes.
bool guideFits(const GuidePlan& guide, size_t pixels, size_t memory);

// The same of nlm (which is none), neural or oidn. Throws Error where its library or model cannot be had.
bool guideFits(const std::string& choice, const BaseOptions& base, const deep::DenoisePlan& plan, size_t pixels,
               size_t memory);

// The plan for a choice: auto, nlm, neural, oidn, none (then there is none) or a file. `oidn` prefilters its own guides
// where that promises the smaller error (cli/method_choice, on the middle of the first frame, `source`). `neural` is
// `base` where no model is named: `small` is no gain. `auto` is Open Image Denoise where it is found, else the network
// where it is installed (cli/denoise_job takes the layered one instead where samples are few): bins and pixels take of a
// guide what the noisy frame confirms, and gain even where it is worse than our own filter (fur). Where the base is to be
// chosen (kAutoBase), the network may promise less error than Open Image Denoise and take its place. Both take whole
// frames; where that is more than `memory` bytes for `source`, or where neither is there, Quality::Best takes our own flat
// filter, which makes the flattened frame as good as any flat one, for two thirds more time. No guide for Quality::Fast,
// for published filters and for frames that say nothing of their noise. Adds to `notes` what it chose, where there was a
// choice, and what did not fit. Throws Error where the choice cannot be had.
std::optional<GuidePlan> planGuide(const std::string& choice, const BaseOptions& base, const deep::DenoisePlan& plan,
                                   FrameSource& source, size_t memory, std::set<std::string>& notes);

// The guide of an image, which for wholeFrame is a whole frame.
deep::BaseGuide guideOf(const deep::DeepImage& image, const GuidePlan& guide, const FrameInputs& inputs,
                        const deep::DenoisePlan& plan, const Progress& progress);

// The guide of a whole frame that is read in pieces of so many rows.
deep::BaseGuide readGuide(FrameSource& source, int rowsAtOnce, const GuidePlan& guide, const FrameInputs& inputs,
                          const deep::DenoisePlan& plan);

}  // namespace fathom::cli
