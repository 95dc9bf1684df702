#include "flat/progressive.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "base/parallel.h"
#include "flat/finite.h"
#include "flat/light.h"
#include "flat/mix_planes.h"
#include "flat/neural_planes.h"

namespace fathom::flat {

namespace {

constexpr float kTiny = 1e-30f;  // of errors
constexpr float kPower = 2;      // of estimated errors in weights; nn/train/mix_model.py has the same
constexpr float kMostOdds = 2;   // logarithm: so that the share still falls with the noise, as equation 9 has it

// How many times too small the variance that so many samples give may be; 1 where their number is not known.
float doubt(float samples) {
  return samples > 1 ? (samples + 11) / (samples - 1) : 1;
}

// How much of the denoised value is taken: equation 9, or all where both are equally good; its odds times `odds`.
float shareOf(float error, float variance, float covariance, float odds) {
  const float ours = odds * std::max(variance - covariance, 0.0f), theirs = error - covariance;
  return theirs > 0 ? ours / (ours + theirs) : 1.0f;
}

// Equation 8.
float errorOf(float share, float error, float variance, float covariance) {
  const float rest = 1 - share;
  return std::max(rest * rest * variance + share * share * error + 2 * share * rest * covariance, 0.0f);
}

// Weights of candidates in a pixel, which sum to 1. `logits`: what the network says of each, or nothing.
void weigh(std::span<const Candidate> candidates, const std::vector<Buffer<float>>& logits, size_t i,
           std::span<float> weights) {
  float most = -std::numeric_limits<float>::infinity();
  for (size_t n = 0; n < candidates.size(); ++n) {
    float error = 0;
    bool finite = true;
    for (size_t c = 0; c < 3; ++c) {
      error += candidates[n].map.error[c][i];
      finite = finite && isFinite(candidates[n].denoised.get(kRgbNames[c]).values[i]);
    }
    const float logit = -kPower * std::log(std::max(error, kTiny)) + (logits.empty() ? 0 : logits[n][i]);
    weights[n] = finite ? logit : -std::numeric_limits<float>::infinity();
    most = std::max(most, weights[n]);
  }
  float sum = 0;
  for (float& w : weights) sum += w = std::exp(w - most);
  for (float& w : weights) w = sum > 0 ? w / sum : 1 / float(weights.size());  // none is finite: NaN stays
}

// The candidates' weighted mean as one of them. Its error is the mean one less how far they are apart (exact for true
// errors, by the ambiguity decomposition of Krogh and Vedelsby 1995), but not less than what independent errors leave.
Candidate merge(std::span<const Candidate> candidates, const std::vector<Buffer<float>>& logits) {
  const Image& like = candidates[0].denoised;
  const Box& window = like.dataWindow;
  Candidate result{{window, like.displayWindow, {}, {}}, {}, {}, {}};
  std::array<float*, 3> means;
  for (const char* name : kRgbNames) result.denoised.add(name);
  for (size_t c = 0; c < 3; ++c) {
    means[c] = result.denoised.find(kRgbNames[c])->values.data();
    for (auto* planes : {&result.map.error, &result.map.variance, &result.map.covariance})
      (*planes)[c] = Buffer<float>(window.area());
  }
  parallelFor(0, window.height(), [&](int row) {
    std::vector<float> weights(candidates.size());
    for (size_t i = size_t(row) * size_t(window.width()); i < size_t(row + 1) * size_t(window.width()); ++i) {
      weigh(candidates, logits, i, weights);
      for (size_t c = 0; c < 3; ++c) {
        float mean = 0, square = 0, error = 0, least = 0, variance = 0, covariance = 0;
        for (size_t n = 0; n < candidates.size(); ++n) {
          const ErrorMap& map = candidates[n].map;
          const float w = weights[n], y = candidates[n].denoised.get(kRgbNames[c]).values[i];
          if (!(w > 0)) continue;
          mean += w * y;
          square += w * y * y;
          error += w * map.error[c][i];
          least += w * w * map.error[c][i];
          variance += w * map.variance[c][i];
          covariance += w * map.covariance[c][i];
        }
        const float apart = std::max(square - mean * mean, 0.0f);
        means[c][i] = mean;
        result.map.error[c][i] = apart < kLargest ? std::max(error - apart, least) : error;
        result.map.variance[c][i] = variance;
        result.map.covariance[c][i] = covariance;
      }
    }
  });
  return result;
}

}  // namespace

Image mix(const Image& noisy, const Noise& noise, const Image& denoised, const ErrorMap& map, const Buffer<float>& k,
          const Buffer<float>& odds) {
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
          const float changed = odds.empty() ? 1 : std::exp(std::clamp(odds[i], -kMostOdds, kMostOdds));
          const float share = std::min(shareOf(map.error[c][i], doubtful * variance, map.covariance[c][i], changed),
                                       1 - k[i] / doubtful);
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
                    const ProgressiveParams& params, const Progress& progress) {
  nn::MixLogits logits;
  if (params.net) logits = params.net->run(mixSource(noisy, noise, candidates), progress);
  Candidate merged;
  const bool several = candidates.size() > 1;
  if (several) {
    merged = merge(candidates, logits.weight);
    merged.k = gate(noisy, noise, merged.denoised, params.gate);
  }
  const Candidate& mean = several ? merged : candidates[0];
  Image result = mix(noisy, noise, mean.denoised, mean.map, mean.k, logits.share);
  if (!params.net) return result;
  // The network's weights favour the darker candidate: they are learned by relative errors.
  std::vector<uint8_t> converged(result.dataWindow.area());
  for (size_t i = 0; i < converged.size(); ++i) converged[i] = noise.pixel[i] == PixelNoise::Converged;
  keepLight(noisy, converged, result, 1 / exposureOf(noisy));
  return result;
}

Image denoiseProgressively(const Image& noisy, std::span<const Estimator> estimators, const ProgressiveParams& params,
                           const Progress& progress) {
  const Noise noise = noiseOf(noisy);
  return mixCandidates(noisy, noise, makeCandidates(noisy, noise, estimators, params, progress), params);
}

Image denoiseProgressively(const Image& noisy, const Denoiser& denoiser, const ProgressiveParams& params,
                           const Progress& progress) {
  const Estimator estimators[] = {byProbes(denoiser, params.sure)};
  return denoiseProgressively(noisy, estimators, params, progress);
}

}  // namespace fathom::flat
