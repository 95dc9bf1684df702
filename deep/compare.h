// How far a deep image is from a reference with the same bins: per bin, on both sides of clip planes, and flattened.
//
// Per bin: squared errors of the colours that are not premultiplied, weighted by the bins' effective alpha; bins with
// alpha that enough camera samples of the reference saw. Clipped: what the samples on one side of a plane contribute to
// their pixels, each attenuated by everything in front of it; over the pixels in which that side has alpha. Volumes are
// split by the plane. Bins of few reference samples stay in here: their alpha is small, and without them a pixel would
// not be whole.
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "deep/image.h"
#include "flat/metrics.h"

namespace fathom::deep {

struct DeepMetricParams {
  bool correct = false;   // subtract the reference's own error, which needs its `variance.{R,G,B}`
  float minSamples = 16;  // camera samples of the reference (its channel `samples`) below which a bin is left out
  std::vector<float> clips = {};  // depths of clip planes; a plane belongs to what is behind it
};

struct BinMetrics {
  double relMse = 0, mse = 0;
  std::optional<double> ownRelMse;  // the reference's own error, where it carries variances
  size_t bins = 0;                  // compared
  size_t excluded = 0;              // not finite on either side
  double leftOut = 0;               // share of the effective alpha in bins of too few reference samples
};

struct ClipMetrics {
  float depth = 0;
  std::optional<flat::Metrics> front, behind;  // nothing where no pixel has alpha there
};

struct DeepMetrics {
  BinMetrics bins;
  std::vector<ClipMetrics> clips;
  flat::Metrics flattened;
};

// The depth that half of the image's effective alpha stands in front of.
float medianDepth(const DeepImage& image);

// R, G, B and A of what lies in [near, far), where an infinite `far` has everything in it, as it shows in the whole
// image; with the variances of the image, if it has them.
flat::Image visiblePart(const DeepImage& image, float near = -std::numeric_limits<float>::infinity(),
                        float far = std::numeric_limits<float>::infinity());

// Gives a deep reference without variances those that its camera samples make likely: a bin's noise is that of the same
// bin of `noisy` (which has variance.{R,G,B} and `samples`) with as many samples as the reference's `samples` counts.
// Bins must agree as for `compare`, and both have `samples`; else an Error says what is missing.
void addOwnVariance(const DeepImage& noisy, DeepImage& reference);

// Both images tidy, with the same windows and the same number of samples in each pixel, else an Error says where they
// differ.
DeepMetrics compare(const DeepImage& image, const DeepImage& reference, const DeepMetricParams& params = {});

}  // namespace fathom::deep
