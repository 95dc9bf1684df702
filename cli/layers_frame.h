// The layered network in `fathom denoise`: --method layers.
#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "cli/band.h"
#include "cli/base_denoiser.h"
#include "cli/frame_guide.h"
#include "cli/frame_source.h"
#include "deep/layers.h"

namespace fathom::cli {

// What a deep frame is made into.
enum class LayersOutput {
  Bins,       // its bins, which the deep filter denoises and the network's flat frame guides
  LayerBins,  // its bins, or camera samples, in the colours of their layers
  Layers,     // a deep sample for each layer
  Flat,
};

struct LayersOptions {
  int count = 2;  // 1, 2 or 4
  LayersOutput output = LayersOutput::Bins;
};

struct LayersPlan {
  std::shared_ptr<const nn::LayersNet> net;
  deep::LayersParams params;
  LayersOutput output;
  std::string settings;  // all that decides what comes out, as text to be hashed
};

// `memory`: of the whole run. Throws Error where the model cannot be had.
LayersPlan planLayers(const BaseOptions& base, const LayersOptions& options, deep::Quality quality, size_t memory);

// Whether the plan's memory does for frames of this data window.
bool layersFit(const LayersPlan& plan, const Box& dataWindow);

// One frame on its way through the network.
class LayersFrame {
 public:
  // Opens it, and reads it once for what the whole frame decides. `clustered`: it holds camera samples, which become bins
  // first. Throws Error where it is not deep, or without R, G, B, A or Z.
  LayersFrame(const LayersPlan& plan, const FrameInputs& inputs, const SourceOptions& options, bool clustered = false);

  FrameSource& source() { return source_; }
  const std::set<std::string>& notes() const { return notes_; }
  const deep::LayerInputs& inputs() const { return layers_.inputs; }

  std::vector<Band> bands() const;
  // The rows of one of the bands, as the plan's output has them (Flat: as layers).
  deep::DeepImage denoise(const Band& band, const Progress& progress, deep::DenoiseStats* stats);
  // R, G, B and A of the whole frame.
  flat::Image flattened(const Progress& progress);

  LayersFrame(const LayersFrame&) = delete;
  LayersFrame& operator=(const LayersFrame&) = delete;

 private:
  const LayersPlan plan_;
  FrameSource source_;
  std::set<std::string> notes_;
  deep::Attributes attributes_;
  deep::LayerSource layers_;  // reads source_
  deep::LayerScale scale_;
};

// Frames' flat guides by the network; of `cameraSamples` from the bins that they are clustered into, as those are better
// (docs/notes.md).
GuidePlan layersGuide(const LayersPlan& plan, const SourceOptions& options, bool cameraSamples);

}  // namespace fathom::cli
