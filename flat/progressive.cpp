#include "flat/progressive.h"

#include <algorithm>
#include <string>
#include <utility>

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

// Weights of candidates in a pixel: the inverses of their errors, summed over channels.
void weigh(std::span<const Candidate> candidates, size_t i, std::span<float> weights) {
  float sum = 0;
  for (size_t n = 0; n < candidates.size(); ++n) {
    float error = 0;
    bool finite = true;
    for (size_t c = 0; c < 3; ++c) {
      error += candidates[n].map.error[c][i];
      finite = finite && isFinite(candidates[n].denoised.get(kRgbNames[c]).values[i]);
    }
    weights[n] = finite ? 1 / std::max(error, 1e-30f) : 0;
    sum += weights[n];
  }
  for (float& w : weights) w = sum > 0 ? w / sum : 1 / float(weights.size());
}

// The candidates' weighted mean as one of them. Its error is the mean one less how far they are apart (exact for true
// errors, by the ambiguity decomposition of Krogh and Vedelsby 1995), but not less than what independent errors leave.
Candidate merge(std::span<const Candidate> candidates) {
  const Image& like = candidates[0].denoised;
  const size_t pixels = like.dataWindow.area();
  Candidate result{{like.dataWindow, like.displayWindow, {}, {}}, {}, {}, {}};
  for (size_t c = 0; c < 3; ++c) {
    result.denoised.add(kRgbNames[c]);
    for (auto* planes : {&result.map.error, &result.map.variance, &result.map.covariance})
      (*planes)[c] = Buffer<float>(pixels, 0.0f);
  }
  std::vector<float> weights(candidates.size());
  for (size_t i = 0; i < pixels; ++i) {
    weigh(candidates, i, weights);
    for (size_t c = 0; c < 3; ++c) {
      float mean = 0, apart = 0, least = 0;
      for (size_t n = 0; n < candidates.size(); ++n) {
        const ErrorMap& map = candidates[n].map;
        const float w = weights[n], y = candidates[n].denoised.get(kRgbNames[c]).values[i];
        if (w > 0) mean += w * y;
        if (w > 0) apart += w * y * y;
        result.map.error[c][i] += w * map.error[c][i];
        result.map.variance[c][i] += w * map.variance[c][i];
        result.map.covariance[c][i] += w * map.covariance[c][i];
        least += w * w * map.error[c][i];
      }
      float& error = result.map.error[c][i];
      error = std::max(error - std::max(apart - mean * mean, 0.0f), least);
      result.denoised.find(kRgbNames[c])->values[i] = mean;
    }
  }
  return result;
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

Estimator byProbes(Denoiser denoiser, const SureParams& params) {
  return [denoiser = std::move(denoiser), params](const Image& noisy, const Noise& noise, const Progress& progress) {
    const double runs = 1 + std::max(1, params.probes);
    Answer answer{denoiser(noisy, {[&](double done) { progress.at(done / runs); }, progress.stop}), {}};
    const Progress rest{[&](double done) { progress.at((1 + done * (runs - 1)) / runs); }, progress.stop};
    answer.estimate = estimateError(noisy, noise, answer.denoised, denoiser, params, rest);
    return answer;
  };
}

Candidate makeCandidate(const Image& noisy, const Noise& noise, Answer answer, const ProgressiveParams& params) {
  Candidate candidate{std::move(answer.denoised), {}, {}, {}};
  candidate.map = mapErrors(answer.estimate, noise, candidate.denoised, params.map);
  candidate.spread = std::move(answer.estimate.spread);
  candidate.k = gate(noisy, noise, candidate.denoised, params.gate);
  return candidate;
}

std::vector<Candidate> makeCandidates(const Image& noisy, const Noise& noise, std::span<const Estimator> estimators,
                                      const ProgressiveParams& params, const Progress& progress) {
  std::vector<Candidate> candidates;
  const double count = double(estimators.size());
  for (const Estimator& estimate : estimators) {
    const double before = double(candidates.size());
    const Progress part{[&](double done) { progress.at((before + done) / count); }, progress.stop};
    candidates.push_back(makeCandidate(noisy, noise, estimate(noisy, noise, part), params));
  }
  return candidates;
}

Image mixCandidates(const Image& noisy, const Noise& noise, std::span<const Candidate> candidates,
                    const ProgressiveParams& params) {
  if (candidates.size() == 1)
    return mix(noisy, noise, candidates[0].denoised, candidates[0].map, candidates[0].k);
  const Candidate one = merge(candidates);
  return mix(noisy, noise, one.denoised, one.map, gate(noisy, noise, one.denoised, params.gate));
}

Image denoiseProgressively(const Image& noisy, const Denoiser& denoiser, const ProgressiveParams& params,
                           const Progress& progress) {
  const Noise noise = noiseOf(noisy);
  const Estimator estimators[] = {byProbes(denoiser, params.sure)};
  return mixCandidates(noisy, noise, makeCandidates(noisy, noise, estimators, params, progress), params);
}

}  // namespace fathom::flat
