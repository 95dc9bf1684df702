#include "flat/error_map.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "flat/bilateral.h"
#include "flat/finite.h"
#include "flat/level.h"

namespace fathom::flat {

namespace {

constexpr BilateralParams kWindow{.radius = 5, .sigma = 2.5f, .sharpness = 2};
constexpr float kFloor = 4e-4f;  // of the squared mean colour: 1e-4 where that is 0.5
constexpr float kLargestSquare = 1e30f;

enum Quantity { kSure, kSpread, kVariance, kCovariance, kQuantities };

Padded padded(const Box& window, const Buffer<float>& values, float largest) {
  Padded plane(window.width(), window.height(), kWindow.radius);
  for (int y = 0; y < window.height(); ++y)
    for (int x = 0; x < window.width(); ++x) {
      const float v = values[size_t(y) * size_t(window.width()) + size_t(x)];
      plane.row(y)[x] = std::abs(v) <= largest ? v : 0;
    }
  plane.extend();
  return plane;
}

std::vector<Padded> outputs(const Box& window, size_t count) {
  std::vector<Padded> planes;
  for (size_t i = 0; i < count; ++i) planes.emplace_back(window.width(), window.height(), 0);
  return planes;
}

// How the first guess follows from what is smoothed: ratio * spread + rest * variance.
struct Prior {
  double ratio = 1, rest = 0;
};

Prior priorOf(const ErrorEstimate& estimate, const Noise& noise, float mostRatio) {
  const auto sizeOf = [&](size_t c, size_t i) {
    return std::fabs(estimate.error[c][i]) + estimate.spread[c][i] + noise.variance[c][i];
  };
  LevelSum sizes;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < estimate.error[c].size(); ++i) sizes.add(double(sizeOf(c, i)));
  const double limit = std::min(sizes.limit(kAbsurd), double(kLargest));
  double sure = 0, spread = 0, variance = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < estimate.error[c].size(); ++i) {
      if (!(double(sizeOf(c, i)) < limit)) continue;
      sure += double(estimate.error[c][i]);
      spread += double(estimate.spread[c][i]);
      variance += double(noise.variance[c][i]);
    }
  Prior prior;
  if (spread > 0) prior.ratio = std::clamp(sure / spread, 1.0, double(mostRatio));
  const double rest = sure - prior.ratio * spread;
  if (rest > 0 && variance > 0) prior.rest = rest / variance;
  return prior;
}

// The variance of SURE but for noiseFactor: the noise's variance squared, in the means of the window.
std::vector<Padded> noiseOfMeans(const Noise& noise, const Box& window, const BilateralParams& params,
                                 const Buffer<uint8_t>& wanted, std::span<const Padded> guide) {
  std::vector<Padded> squares, result = outputs(window, 3);
  for (const Buffer<float>& variance : noise.variance) {
    Buffer<float> square(variance.size());
    for (size_t i = 0; i < square.size(); ++i) square[i] = variance[i] * variance[i];
    squares.push_back(padded(window, square, kLargestSquare));
  }
  bilateralVariance(window.width(), window.height(), params, wanted, guide, squares, result);
  return result;
}

float shrunk(float sure, float spread, float variance, float noise, const Prior& prior, const ErrorMapParams& params) {
  // Squares of variances that no normal float holds say nothing.
  const double p = prior.ratio * double(spread) + prior.rest * double(variance),
               n = noise >= FLT_MIN ? double(params.noiseFactor) * double(noise) : 0;
  const double weight = p * p + n;
  const double error = weight > 0 ? (double(sure) * p * p + p * n) / weight : double(sure);
  return float(std::max(error, double(params.leastSpread) * double(spread)));
}

}  // namespace

ErrorMap mapErrors(const ErrorEstimate& estimate, const Noise& noise, const Image& denoised,
                   const ErrorMapParams& params) {
  const Box& window = denoised.dataWindow;
  const size_t width = size_t(window.width());
  std::vector<Padded> guide;
  for (const char* name : kRgbNames) guide.push_back(padded(window, denoised.get(name).values, kLargest));
  BilateralParams bilateralParams = kWindow;
  bilateralParams.floor = kFloor * noise.level * noise.level;
  const Buffer<uint8_t> wanted(window.area(), 1);
  const Prior prior = priorOf(estimate, noise, params.mostRatio);
  const std::vector<Padded> noises = noiseOfMeans(noise, window, bilateralParams, wanted, guide);
  ErrorMap map;
  for (size_t c = 0; c < 3; ++c) {
    std::vector<Padded> in, out = outputs(window, kQuantities);
    for (const Buffer<float>* plane :
         {&estimate.error[c], &estimate.spread[c], &noise.variance[c], &estimate.covariance[c]})
      in.push_back(padded(window, *plane, kLargestSquare));
    bilateral(window.width(), window.height(), bilateralParams, wanted, guide, in, out);
    for (auto* planes : {&map.error, &map.variance, &map.covariance}) (*planes)[c] = Buffer<float>(window.area());
    parallelFor(0, window.height(), [&](int y) {
      for (size_t x = 0; x < width; ++x) {
        const size_t i = size_t(y) * width + x;
        const float variance = out[kVariance].row(y)[x];
        map.variance[c][i] = variance;
        map.error[c][i] =
            shrunk(out[kSure].row(y)[x], out[kSpread].row(y)[x], variance, noises[c].row(y)[x], prior, params);
        // No covariance is beyond what both variances allow.
        const float most = std::sqrt(variance) * std::sqrt(map.error[c][i]);
        map.covariance[c][i] = std::clamp(out[kCovariance].row(y)[x], 0.0f, most);
      }
    });
  }
  return map;
}

Image errorPlanes(const ErrorEstimate& estimate, const Noise& noise, const Image& denoised) {
  ErrorMap map = mapErrors(estimate, noise, denoised);
  Image planes{denoised.dataWindow, denoised.displayWindow, {}, {}};
  for (size_t c = 0; c < 3; ++c)
    planes.planes.push_back({std::string("error.") + kRgbNames[c], std::move(map.error[c])});
  return planes;
}

Image errorPlanes(const Image& noisy, const Image& denoised, const Denoiser& denoiser, const SureParams& params,
                  const Progress& progress) {
  const Noise noise = noiseOf(noisy);
  return errorPlanes(estimateError(noisy, noise, denoised, denoiser, params, progress), noise, denoised);
}

}  // namespace fathom::flat
