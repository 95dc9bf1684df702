// A flat denoiser as everything that only runs one sees it.
#pragma once

#include <functional>

#include "base/progress.h"
#include "flat/image.h"

namespace fathom::flat {

// A plane that an image may have: where it is 0 a denoiser need not work, and may leave the render.
inline constexpr const char* kAsked = "asked";

// From a noisy image with the channels of DATA.md (R, G and B at least) to its denoised R, G and B, in planes of these
// names over the same window. A pure function: the same bits for the same input. Throws Error and Cancelled.
using Denoiser = std::function<Image(const Image& noisy, const Progress& progress)>;

}  // namespace fathom::flat
