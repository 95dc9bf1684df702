// The compositional network as a flat denoiser.
//
// Source: nn/compositional.h. Where a frame has its diffuse and its specular light apart, each is denoised by itself, the
// diffuse one divided by the albedo (flat/neural_planes), and the results are added, as in Bako et al. 2017; the whole
// light else.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "flat/denoiser.h"
#include "nn/compositional.h"

namespace fathom::flat {

struct NeuralParams {
  int components = 0;  // that each light is split into: 1, 2 or 4; 0: what each tile is worth (nn/tile_plan)
  size_t memory = 0;   // bytes that the network may work in, beside its planes; 0: as many as it likes
};

// Pixels of all lights: those that went through the network, of these those with 2 and 4 components, and those in blocks
// without anything to denoise.
struct NeuralCounts {
  std::atomic<uint64_t> denoised = 0, inTwo = 0, inFour = 0, skipped = 0;
};

// R, G and B of the network, and beside them diffuse.* and specular.* where the image has both. Values are finite and not
// negative; what is not finite in the input counts as 0. Converged pixels (flat/noise) keep the render, and a pixel with A
// = 0 and no colour stays black; blocks of nothing but these are skipped. A scaled frame is denoised alike, to 1e-4, over twelve
// powers of ten, by the exposure of the whole frame, in which each pixel has its share; one mirrored or turned need not be.
// What light the frame lacks then comes back (flat/light).
// The same bits for any number of threads. Images may have any of the channels of DATA.md, and R, G and B at least. Adds to
// `counts` where it is given.
Image denoiseNeural(const nn::CompositionalNet& net, const NeuralParams& params, const Image& noisy,
                    const Progress& progress = {}, NeuralCounts* counts = nullptr);

Denoiser neural(std::shared_ptr<const nn::CompositionalNet> net, const NeuralParams& params,
                std::shared_ptr<NeuralCounts> counts = {});

// Bytes that this takes beside the image, at most, for so many pixels.
size_t neuralBytes(const nn::CompositionalNet& net, const NeuralParams& params, size_t pixels);

}  // namespace fathom::flat
