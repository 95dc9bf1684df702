// What a denoiser of flat images says of a deep frame: of the flattened frame, and of its bins.
//
// Source: Fathom's own. Clean bins need not be found from bins alone: a flat denoiser (a network, say) knows more about
// pictures, and a deep frame has several in it - the flattened one, and for each k that of the k-th bins (deep/bin_image).
// What it makes of the latter is a second estimate of every bin, to be mixed with the deep filter's (deep/bin_mix: they
// err differently); what it makes of the former is what the bins are made to add up to (deep/consistency).
#pragma once

#include <vector>

#include "deep/bin_image.h"
#include "deep/flat_noisy.h"
#include "flat/denoiser.h"
#include "flat/mix_kernel.h"

namespace fathom::deep {

inline constexpr int kMostBinImages = 4;

// How far bins follow a guide: see deep/consistency.
struct ConsistencyParams {
  // The expected squared error of a bin is relative c^2 + noise s^2 + bias^2, of what the gate found: s^2 the noise of the
  // bin before filtering, bias^2 what is left of the filter's bias. The first is for what nothing tells.
  float relative = 0.005f;
  float noise = 0.1f;
  float alphaNoise = 0.25f;
  float mostDeviations = 10;
  // The prior share of the bins' own sum in what a pixel should be, and its strength (flat/mix).
  flat::MixParams mix{.prior = 0.4f, .strength = 20};
  // The prior share of the deep filter's bins in their mix with the pictures' (deep/bin_mix).
  float binPrior = 0.5f;
};

// For our own networks, which err more than Open Image Denoise does, and leave noise of the render in what they make, which
// a weak prior takes for detail.
inline constexpr ConsistencyParams kNetworkGuide{.mix = {.prior = 0.55f, .strength = 40}, .binPrior = 0.6f};

// For a guide that errs as much as the bins' sum, and alike: our own filter on flat pixels.
inline constexpr ConsistencyParams kOwnGuide{.alphaNoise = 0.5f, .mix = {.prior = 0.8f, .strength = 20}};

struct GuideDenoisers {
  flat::Denoiser flattened;
  flat::Denoiser bins;  // none: bins are not guided
  ConsistencyParams consistency;
};

// Made row by row, so that a frame need not be in memory as a deep image.
struct GuideInput {
  flat::Image noisy;
  std::vector<flat::Image> bins;  // none, or kMostBinImages
  std::vector<double> shares;     // of bins' effective alpha, by image
  Buffer<uint8_t> calm;           // deep/still's pixels without noise of their own; empty where no bins are guided
};

// `withBins`: bins are guided, too. The image follows DATA.md, as `denoise` takes it.
GuideInput guideInput(const DeepImage& image, const DenoisePlan& plan, bool withBins);

// Puts the rows of `below` under those of `above`.
void appendRows(GuideInput& above, const GuideInput& below);

struct BaseGuide {
  flat::Image noisy;              // R G B, variances and `samples` of the flattened frame
  flat::Image flattened;          // its denoised R G B, gated (flat/gate)
  std::vector<flat::Image> bins;  // R G B of the k-th bins
  ConsistencyParams consistency;
};

// Runs the denoisers, asking for nothing (flat::kAsked) that no pixel with noise in reach of the plan's filter can see.
// Pictures of bins that hold less than a fiftieth of the light's weight are not worth a run. Throws Error where the frame
// says nothing of its noise, what the denoisers throw, and Cancelled.
BaseGuide makeGuide(GuideInput input, const GuideDenoisers& denoisers, const DenoisePlan& plan,
                    const Progress& progress = {});

// The rows [y0, y1) of a guide.
BaseGuide guideRows(const BaseGuide& guide, int y0, int y1);

}  // namespace fathom::deep
