// A render and its denoised self mixed per pixel and channel: as good as the denoiser while that helps, and the render
// where and when it does not any more.
//
// Source: Firmino et al., "Progressive Denoising of Monte Carlo Rendered Images", section 4: z = x + a (y - x) with x
// the render, y the denoised and a = (s^2 - s^2 f') / (SURE + s^2 - 2 s^2 f') (equation 9), in [0,1], from quantities
// smoothed alike (flat/error_map). Departures, each measured (docs/notes.md):
// - The paper gives equation 9 to a network to imitate, since raw SURE is too noisy. Here it is used as it is, with the
//   error map of flat/error_map in place of SURE: 6 % less error than the denoiser on average and hardly ever more,
//   where smoothed SURE itself gives 14 % more.
// - s^2 is the larger of a pixel's own variance and the smoothed one: a firefly knows that it is one. Times
//   (n + 11) / (n - 1) for n samples, by which the gate is weakened, too: variances of few samples are poor. From 32 on that
//   changes nothing; with 2, 4 and 8 the mix was up to 1.33, 1.06 and 1.05 times as wrong as the denoiser without.
// - The t-statistic gate is not that of equations 12 to 18 but flat/gate, which compares residuals where colours are
//   alike. The paper's window lets its noisiest pixel decide, and its variance is too small where noise has heavy
//   tails: it doubled the error of one frame. Convergence has the same reason: the variance of the mean residual falls,
//   and what bias there is is taken back.
// - The error of the mix is estimated with it (equation 8).
// - Several denoised images are first mixed with one another, by the inverse squares of their estimated errors (the
//   inverses are best for errors that have nothing in common, which those of denoisers have), then with the render.
// - A network (nn/mix) may correct both: the logarithms of the weights of denoised images, and of the odds of their
//   mean against the render. The latter is bounded, and the gate has the last word, so that the law of convergence
//   holds whatever it says: shares fall with the variance of the render by equation 9, times a constant at most.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "flat/error_map.h"
#include "flat/gate.h"
#include "nn/mix.h"

namespace fathom::flat {

struct ProgressiveParams {
  SureParams sure;
  ErrorMapParams map;
  GateParams gate;
  std::shared_ptr<const nn::MixNet> net = {};  // corrects weights and shares, where it is given
};

// The mix from what is known: R, G, B, and error.R, error.G, error.B, the expected squared error of each. `k` is the
// gate's; `odds`, where it is not empty, has a logarithm by which the odds of the denoised value against the render are
// changed. Converged pixels are the render itself, with an error of 0; where the noise is unknown, or the render not
// finite, stands the denoised value (0 where that is not finite either).
Image mix(const Image& noisy, const Noise& noise, const Image& denoised, const ErrorMap& map, const Buffer<float>& k,
          const Buffer<float>& odds = {});

// A denoised render, and what is known of it without a reference.
struct Candidate {
  Image denoised;  // R, G, B
  ErrorMap map;
  std::array<Buffer<float>, 3> spread;  // as ErrorEstimate has it
  Buffer<float> k;                      // the gate's
};

// What a denoiser makes of a render, and how wrong that is.
struct Answer {
  Image denoised;
  ErrorEstimate estimate;
};
using Estimator = std::function<Answer(const Image& noisy, const Noise& noise, const Progress& progress)>;

// By 1 + probes runs of the denoiser.
Estimator byProbes(Denoiser denoiser, const SureParams& params = {});

Candidate makeCandidate(const Image& noisy, const Noise& noise, Answer answer, const ProgressiveParams& params = {});

// One after the other; their part of the progress is about that of their time.
std::vector<Candidate> makeCandidates(const Image& noisy, const Noise& noise, std::span<const Estimator> estimators,
                                      const ProgressiveParams& params = {}, const Progress& progress = {});

// The mix of the render and one candidate or more, whose order does not matter; with a network, what light it lacks
// comes back (flat/light).
Image mixCandidates(const Image& noisy, const Noise& noise, std::span<const Candidate> candidates,
                    const ProgressiveParams& params = {}, const Progress& progress = {});

// All steps, for a render that says something of its noise (see noiseOf).
Image denoiseProgressively(const Image& noisy, std::span<const Estimator> estimators,
                           const ProgressiveParams& params = {}, const Progress& progress = {});

// With one denoiser.
Image denoiseProgressively(const Image& noisy, const Denoiser& denoiser, const ProgressiveParams& params = {},
                           const Progress& progress = {});

}  // namespace fathom::flat
