// What a flat render says of its own noise: the variances of its pixels' means, and where there are none.
#pragma once

#include <array>
#include <cstdint>

#include "flat/image.h"

namespace fathom::flat {

inline constexpr std::array<const char*, 3> kRgbNames{"R", "G", "B"};

// Black without variance is not yet converged: where light is found by one camera sample in a thousand, most pixels are
// black at first. It is where the 5x5 pixels around are as black. (Taken for converged, such pixels tripled the error
// of a frame lit through a door ajar.)
enum class PixelNoise : uint8_t {
  Known,
  Converged,  // variance 0 in all channels, from four camera samples or more: the render is the truth
  Unknown,    // variance 0 from fewer, only one half has samples, or a colour or variance is not finite
};

// All planes are of the image's data window.
struct Noise {
  std::array<Buffer<float>, 3> variance;  // of the means R, G, B as the file has them; finite, 0 where not Known
  Buffer<PixelNoise> pixel;
  Buffer<float> samples;  // camera samples, 1 at least; 1 where the file does not tell
  float level = 0.5f;     // of the finite colours, which constants scale with (flat/level)
};

// The attribute fathom:spp; 0: the image does not tell.
int sppOf(const Image& image);

// Whether an image says anything of its noise.
bool tellsNoise(const Image& image);

// From variance.{R,G,B}, else the two-buffer variance n0 n1 / (n0 + n1)^2 (m0 - m1)^2 of half0.* and half1.* (R G B, or
// the sum of diffuse.* and specular.*). Counts are those of `samples`, else the attribute fathom:spp; where neither is
// there, a variance of 0 counts as known to be 0. Throws Error where the image has no R G B or says nothing of its
// noise.
Noise noiseOf(const Image& image);

}  // namespace fathom::flat
