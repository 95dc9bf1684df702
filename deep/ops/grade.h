// Grading: gain, offset, gamma and saturation of colours, everywhere or between two depths.
#pragma once

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "deep/image.h"

namespace fathom::deep {

struct GradeParams {
  std::vector<std::string> channels{"R", "G", "B"};  // or layers; each must end in R, G or B
  std::array<float, 3> gain{1, 1, 1};                // of R, G, B
  std::array<float, 3> offset{0, 0, 0};
  std::array<float, 3> gamma{1, 1, 1};  // > 0; above 1 brightens
  float saturation = 1;                 // 0: grey of the same luminance (Rec. 709)
  // Where it works: fully from `near` to before `far`, falling off smoothly (3t^2 - 2t^3) over the widths before and
  // behind them, which are >= 0. An infinite `far` has no end, depths of infinity included.
  float near = -std::numeric_limits<float>::infinity(), far = std::numeric_limits<float>::infinity();
  float nearWidth = 0, farWidth = 0;
};

// The image with (colour * gain + offset) ^ (1 / gamma), then saturation, as the ASC CDL has it, of colours that are
// not premultiplied; they come and go premultiplied. All but gamma is linear: flattening gives the same grade of the
// flattened colour, and a sample without alpha, which only emits, gets gain and saturation. Gamma leaves such samples
// and negative values alone. The depth of a volume is its middle: volumes are not cut.
//
// Samples outside of the depths pass bit for bit; in the others, values that are not finite count as 0, and results end
// at 1e15. Alphas count as opacity() has them and stay, and so does every channel that is not named: where R G B alone
// is graded, it is no longer the sum of components. Variances and half buffers of what is graded are left out: see
// statisticsOf. Halo 0. Throws Error when A or Z is missing, when a name is no channel or not one of R, G and B, when
// gamma is not > 0 or another number not finite, and when saturation is asked for where R, G or B is missing.
DeepImage grade(DeepImage image, const GradeParams& params);

}  // namespace fathom::deep
