// A flat denoiser on flat pixels that travel as deep ones.
#pragma once

#include "deep/denoise.h"
#include "flat/denoiser.h"

namespace fathom::deep {

// Takes an image of one opaque bin a pixel (makeOneBin) and returns it with the denoiser's R, G and B, and its diffuse.* and
// specular.* where it has them. Other components, which would no longer add up to the colours, are dropped; so is what
// describes the noisy colours (half*, variance*, counts), unless `keepStatistics`. Throws what the denoiser throws.
DeepImage applyFlat(DeepImage image, const flat::Denoiser& denoiser, bool keepStatistics, const Progress& progress = {},
                    DenoiseStats* stats = nullptr);

}  // namespace fathom::deep
