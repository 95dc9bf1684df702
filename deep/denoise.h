// The deep denoiser: clean colours for every bin of a deep Monte Carlo render; bins, alphas and depths stay as they
// are.
//
// Source: Vicini et al., "Denoising Deep Monte Carlo Renderings", sections 4 and 5; the gate is Fathom's own
// (deep/gate).
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "base/progress.h"
#include "deep/image.h"

namespace fathom::flat {
struct NoiseResponse;
class LevelSum;
}  // namespace fathom::flat

namespace fathom::deep {

enum class Quality { Fast, Balanced, Best };

// Our own filter, or a published one to compare with, which has neither qualities nor a gate (deep/filter_passes).
enum class FilterKind { Own, Paper, Rdfc };

// What of the channel convention a file offers. Decided once per sequence, so that frames do not differ in method.
struct DenoiseInputs {
  bool components = false;    // diffuse.* and specular.*; else R G B is the one component
  bool halves = false;        // half0.* and half1.* of the components (or of R G B) with their sample counts
  bool halfCounts = false;    // half0.samples, half1.samples
  bool albedoHalves = false;  // half0.albedo.*, half1.albedo.*
  bool variance = false;      // variance.{R,G,B}
  bool counts = false;        // samples
  bool albedo = false, albedoVariance = false;
  bool normal = false, normalVariance = false;
  bool depthVariance = false;
  bool volumes = false;  // ZBack
  int spp = 0;           // fathom:spp; 0: unknown
};

struct BaseGuide;

DenoiseInputs findDenoiseInputs(std::span<const std::string> channels, const Attributes& attributes);

// One line per thing that is missing and how it is estimated instead, for an artist; empty when all is there.
std::vector<std::string> describeMissing(const DenoiseInputs& inputs);

// Whether the denoiser reads a channel of this name, given what the file offers.
bool denoiseReads(const DenoiseInputs& inputs, const std::string& channel);

struct DenoiseParams {
  Quality quality = Quality::Balanced;
  bool gate = true;
  bool keepStatistics =
      false;  // keep half*, variance* and counts in the output, though they describe the noisy colours
  FilterKind filter = FilterKind::Own;
};

struct DenoisePlan {
  DenoiseInputs inputs;
  DenoiseParams params;
  float level = 0.5f;   // the mean colour of the first frame: absolute constants scale with it
  bool guided = false;  // every image comes with a guide
};

// The level (flat/level) of the flattened R, G and B of the pixels with alpha.
float meanLevel(const DeepImage& image);

// Adds these values of a frame that comes in bands of rows from the top: the same bits however it is cut.
void addLevel(const DeepImage& rows, flat::LevelSum& level);

// How many rows above and below a row decide its result: bands need that much around them.
int denoiseHalo(const DenoisePlan& plan);

// What a run did: seconds by stage, and counts of what was processed, skipped and repaired, by name.
struct DenoiseStats {
  std::map<std::string, double> seconds;
  std::map<std::string, uint64_t> counts;
};

// Takes an image of tidy bins (sorted, see `isTidy`) that follows DATA.md; returns it with R G B and the components
// filtered. Alphas, depths, ids and channels it does not know pass unchanged. `guide`: what a flat denoiser says of the
// same rows (deep/base_guide), where the plan has it. `response` gets how the result moves with the noise, without
// further runs (deep/noise_response); only where the plan tells it, every pixel has one opaque bin, and there is no
// guide. Throws Error (a channel missing) and Cancelled.
DeepImage denoise(DeepImage image, const DenoisePlan& plan, const Progress& progress = {},
                  DenoiseStats* stats = nullptr, const BaseGuide* guide = nullptr,
                  flat::NoiseResponse* response = nullptr);

}  // namespace fathom::deep
