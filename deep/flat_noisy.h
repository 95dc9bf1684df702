// The flat frame that the bins of a render come to, with what it says of its own noise: what a flat denoiser takes.
#pragma once

#include "deep/denoise.h"
#include "flat/image.h"

namespace fathom::deep {

// The bins (tidy, as `denoise` takes them) flattened: R G B A, Z (the mean of what is seen), and where `inputs` has them
// the components, albedo.*, N.* and half buffers (each bin weighing as many of the half's samples as it holds); `samples`,
// the camera samples of a pixel; and the variances of these means, by the law of total variance: with w the effective
// alpha, n the sample count, v the variance of the mean and x the value (not premultiplied) of a bin, N that of the
// pixel,
//   variance = (sum w ((n - 1) v + x^2) - (sum w x)^2) / (N - 1),
// which is the variance that the camera samples themselves have. Values that are not finite count as 0.
flat::Image flattenNoisy(const DeepImage& image, const DenoiseInputs& inputs);

}  // namespace fathom::deep
