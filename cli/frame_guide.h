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

// The plan for a choice: auto, nlm, neural, oidn, none (then there is none) or a file. `oidn` prefilters its own guides
// where that promises the smaller error (cli/method_choice, on the middle of the first frame, `source`). `auto` is Open
// Image Denoise where it is found: bins and pixels take of it what the noisy frame confirms, and gain even where it is
// worse than our own filter (fur); where the base is to be chosen (kAutoBase), the network may promise less error and take
// its place. Where it is not found, Quality::Best takes the network or our own flat filter, as they promise; the latter it makes the flattened frame as good as
// any flat one, for two thirds more time. None for Quality::Fast, for published filters and for frames that say nothing of
// their noise, nor where one that takes whole frames would need more than `memory` bytes for `source`. Adds to `notes` what
// it chose. Throws Error where the choice cannot be had.
std::optional<GuidePlan> planGuide(const std::string& choice, const BaseOptions& base, const deep::DenoisePlan& plan,
                                   FrameSource& source, size_t memory, std::set<std::string>& notes);

// The guide of an image, which for wholeFrame is a whole frame.
deep::BaseGuide guideOf(const deep::DeepImage& image, const GuidePlan& guide, const FrameInputs& inputs,
                        const deep::DenoisePlan& plan, const Progress& progress);

// The guide of a whole frame that is read in pieces of so many rows.
deep::BaseGuide readGuide(FrameSource& source, int rowsAtOnce, const GuidePlan& guide, const FrameInputs& inputs,
                          const deep::DenoisePlan& plan);

}  // namespace fathom::cli
