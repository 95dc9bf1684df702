#include "flat/sure.h"

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "flat/finite.h"
#include "flat/perturb.h"

namespace fathom::flat {

namespace {

constexpr int kGrain = 1 << 14;

// Adds what one run says to the sums of covariance and spread.
void addProbe(const Image& noisy, const Image& denoised, const Image& moved, const Image& result, float size,
              ErrorEstimate& sums) {
  for (size_t c = 0; c < 3; ++c) {
    const Buffer<float>&x = noisy.get(kRgbNames[c]).values, &y = denoised.get(kRgbNames[c]).values,
          &xe = moved.get(kRgbNames[c]).values, &ye = result.get(kRgbNames[c]).values;
    if (ye.size() != x.size() || y.size() != x.size())
      fail("channel {}: expected {} denoised pixels, found {}", kRgbNames[c], x.size(), std::min(y.size(), ye.size()));
    parallelRanges(0, int(x.size()), kGrain, [&](int begin, int end) {
      for (size_t i = size_t(begin); i < size_t(end); ++i) {
        const float step = (xe[i] - x[i]) / size, response = (ye[i] - y[i]) / size;  // the step as rounded
        if (!isFinite(response)) continue;
        sums.covariance[c][i] += step * response;
        sums.spread[c][i] += response * response;
      }
    });
  }
}

// The error from covariance and spread, which are sums over so many probes.
void finish(const Image& noisy, const Noise& noise, const Image& denoised, int probes, ErrorEstimate& estimate) {
  for (size_t c = 0; c < 3; ++c) {
    const Buffer<float>&x = noisy.get(kRgbNames[c]).values, &y = denoised.get(kRgbNames[c]).values;
    parallelRanges(0, int(x.size()), kGrain, [&](int begin, int end) {
      for (size_t i = size_t(begin); i < size_t(end); ++i) {
        float& covariance = estimate.covariance[c][i] /= float(probes);
        float& spread = estimate.spread[c][i] /= float(probes);
        if (!isFinite(covariance) || !isFinite(spread)) covariance = spread = 0;
        if (noise.pixel[i] != PixelNoise::Known) covariance = 0;
        const float residual = y[i] - x[i];
        const float error = residual * residual - noise.variance[c][i] + 2 * covariance;
        const bool known = noise.pixel[i] != PixelNoise::Unknown && isFinite(error);
        if (!known) covariance = 0;
        estimate.error[c][i] = known ? error : spread;
      }
    });
  }
}

}  // namespace

ErrorEstimate estimateError(const Image& noisy, const Noise& noise, const Image& denoised, const Denoiser& denoiser,
                            const SureParams& params, const Progress& progress) {
  const size_t pixels = noisy.dataWindow.area();
  ErrorEstimate estimate;
  for (size_t c = 0; c < 3; ++c)
    for (auto* planes : {&estimate.error, &estimate.covariance, &estimate.spread})
      (*planes)[c] = Buffer<float>(pixels, 0.0f);
  const Perturber perturber(noisy, noise);
  const int probes = std::max(1, params.probes);
  for (int probe = 0; probe < probes; ++probe) {
    const Progress part{[&](double done) { progress.at((probe + done) / probes); }, progress.stop};
    const Image moved = perturber.moved(params.seed, probe, params.size);
    addProbe(noisy, denoised, moved, denoiser(moved, part), params.size, estimate);
  }
  finish(noisy, noise, denoised, probes, estimate);
  progress.at(1);
  return estimate;
}

ErrorEstimate estimateError(const Image& noisy, const Noise& noise, const Image& denoised, NoiseResponse response) {
  ErrorEstimate estimate{{}, std::move(response.covariance), std::move(response.spread)};
  for (Buffer<float>& plane : estimate.error) plane = Buffer<float>(noisy.dataWindow.area());
  finish(noisy, noise, denoised, 1, estimate);
  return estimate;
}

}  // namespace fathom::flat
