// How far an image is from a reference, over R, G and B.
//
// With a an image, r its reference, and v the variance of the reference's mean where it carries `variance.{R,G,B}`:
//   relMSE  mean of (a-r)^2 / (r^2 + 0.01);  own error mean of v / (r^2 + 0.01)
//   MSE     mean of (a-r)^2;                 own error mean of v
//   PSNR    -10 log10 of the MSE of toneMap(a) against toneMap(r), in dB, infinite for equal images
//   SMAPE   mean of |a-r| / (|a| + |r| + 0.01)
//   SSIM    Wang et al. 2004 on the Rec. 709 luminance of the tone-mapped images, peak 1, Gaussian window of 11 x 11
//   pixels and
//           sigma 1.5; mean over the pixels whose whole window is inside (all pixels where an image is smaller than a
//           window)
// An image and an independent reference differ by the errors of both: correcting takes the reference's own part off.
#pragma once

#include <cstddef>
#include <optional>

#include "flat/image.h"

namespace fathom::flat {

struct MetricParams {
  bool correct = false;      // subtract the reference's own error from relMSE and MSE
  double trimmed = 0.001;    // share of the worst pixels that `relMseTrimmed` leaves out
  bool onlyCovered = false;  // only pixels in which the reference's A is above 0
};

struct Metrics {
  double relMse = 0, relMseTrimmed = 0, mse = 0, psnr = 0, smape = 0, ssim = 0;
  std::optional<double> ownRelMse, ownMse;  // the reference's own error, where it carries variances
  size_t pixels = 0;                        // compared
  size_t excluded = 0;                      // not finite on either side: no part of any mean
};

// Data windows must be equal. Throws Error when they are not, when R, G or B is missing (A, with `onlyCovered`), when
// `correct` is asked for without variances, and when no pixel is left to compare.
Metrics compare(const Image& image, const Image& reference, const MetricParams& params = {});

// Per pixel, the root of the mean over R, G, B of (a-r)^2 / (r^2 + 0.01); NaN where either side is not finite.
Plane relativeError(const Image& image, const Image& reference);

// How much the error changes from one frame to the next: mean of (e1 - e0)^2 / (r1^2 + 0.01) with e = a - r. An error
// that stands still flickers 0, an independent one of every frame twice its relMSE.
double flicker(const Image& image0, const Image& reference0, const Image& image1, const Image& reference1,
               const MetricParams& params = {});

}  // namespace fathom::flat
