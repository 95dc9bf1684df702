#include "flat/progressive.h"

#include <algorithm>
#include <string>

#include "base/parallel.h"
#include "flat/finite.h"

namespace fathom::flat {

namespace {

// How many times too small the variance that so many samples give may be; 1 where their number is not known.
float doubt(float samples) {
  return samples > 1 ? (samples + 11) / (samples - 1) : 1;
}

// How much of the denoised value is taken: equation 9, or all where both are equally good.
float shareOf(float error, float variance, float covariance) {
  const float all = error + variance - 2 * covariance;
  return all > 0 ? std::clamp((variance - covariance) / all, 0.0f, 1.0f) : 1.0f;
}

// Equation 8.
float errorOf(float share, float error, float variance, float covariance) {
  const float rest = 1 - share;
  return std::max(rest * rest * variance + share * share * error + 2 * share * rest * covariance, 0.0f);
}

}  // namespace

Image mix(const Image& noisy, const Noise& noise, const Image& denoised, const ErrorMap& map, const Buffer<float>& k) {
  Image result{noisy.dataWindow, noisy.displayWindow, {}, {}};
  for (const char* name : kRgbNames) result.add(name);
  const int width = noisy.dataWindow.width();
  for (size_t c = 0; c < 3; ++c) {
    const Buffer<float>&x = noisy.get(kRgbNames[c]).values, &y = denoised.get(kRgbNames[c]).values;
    Buffer<float> errors(x.size());
    Buffer<float>& values = result.find(kRgbNames[c])->values;
    parallelFor(0, noisy.dataWindow.height(), [&](int row) {
      for (size_t i = size_t(row) * size_t(width); i < size_t(row + 1) * size_t(width); ++i) {
        const bool finite = isFinite(y[i]);
        if (noise.pixel[i] == PixelNoise::Converged || (!finite && isFinite(x[i]))) {
          values[i] = x[i];
          errors[i] = noise.variance[c][i];
        } else if (noise.pixel[i] == PixelNoise::Unknown) {
          values[i] = finite ? y[i] : 0;
          errors[i] = map.error[c][i];
        } else {
          const float variance = std::max(map.variance[c][i], noise.variance[c][i]);
          const float doubtful = doubt(noise.samples[i]);
          const float share =
              std::min(shareOf(map.error[c][i], doubtful * variance, map.covariance[c][i]), 1 - k[i] / doubtful);
          values[i] = share < 1 ? x[i] + share * (y[i] - x[i]) : y[i];
          errors[i] = errorOf(share, map.error[c][i], map.variance[c][i], map.covariance[c][i]);
        }
      }
    });
    result.add(std::string("error.") + kRgbNames[c]).values = std::move(errors);
  }
  return result;
}

Image mixByEstimate(const Image& noisy, const Noise& noise, const Image& denoised, const ErrorEstimate& estimate,
                    const ProgressiveParams& params) {
  const ErrorMap map = mapErrors(estimate, noise, denoised, params.map);
  return mix(noisy, noise, denoised, map, gate(noisy, noise, denoised, params.gate));
}

Image denoiseProgressively(const Image& noisy, const Denoiser& denoiser, const ProgressiveParams& params,
                           const Progress& progress) {
  const Noise noise = noiseOf(noisy);
  const double runs = 1 + std::max(1, params.sure.probes);
  const Image denoised = denoiser(noisy, {[&](double done) { progress.at(done / runs); }, progress.stop});
  const Progress rest{[&](double done) { progress.at((1 + done * (runs - 1)) / runs); }, progress.stop};
  const ErrorEstimate estimate = estimateError(noisy, noise, denoised, denoiser, params.sure, rest);
  return mixByEstimate(noisy, noise, denoised, estimate, params);
}

}  // namespace fathom::flat
