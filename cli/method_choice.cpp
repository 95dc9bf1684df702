#include "cli/method_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "flat/noise.h"
#include "flat/sure.h"

namespace fathom::cli {

Box middleOf(const Box& window) {
  const int width = std::min(kSampleSide, window.width()), height = std::min(kSampleSide, window.height());
  const int x0 = window.x0 + (window.width() - width) / 2, y0 = window.y0 + (window.height() - height) / 2;
  return {x0, y0, x0 + width, y0 + height};
}

double expectedError(const flat::Image& noisy, const flat::Denoiser& denoise, float level) {
  const flat::Noise noise = flat::noiseOf(noisy);
  const flat::Image denoised = denoise(noisy, {});
  const flat::ErrorEstimate estimate = flat::estimateError(noisy, noise, denoised, denoise, {.probes = 1});
  const double dark = 0.04 * double(level) * double(level);  // 0.01 where the mean is 0.5, as in relMSE
  double sum = 0;
  for (size_t c = 0; c < 3; ++c) {
    const Buffer<float>& values = denoised.get(flat::kRgbNames[c]).values;
    for (size_t i = 0; i < values.size(); ++i) {
      const double f = double(values[i]);
      sum += double(estimate.error[c][i]) / (f * f + dark);
    }
  }
  return sum;
}

double expectedErrorOf(const BaseOptions& options, const flat::Image& noisy, const deep::DenoisePlan& plan,
                       const MethodLimits& limits) {
  const BaseDenoiser base = makeBase(options, plan, limits.scratch);
  if (base.bytes && base.bytes(limits.pixels, limits.scratch) > limits.room)
    return std::numeric_limits<double>::infinity();
  return expectedError(noisy, base.denoise, plan.level);
}

MethodChoice chooseMethod(const BaseOptions& options, const flat::Image& noisy, const deep::DenoisePlan& plan,
                          const MethodLimits& limits) {
  if (!flat::tellsNoise(noisy)) return {kOwnBase, "needs to know no noise"};
  std::vector<std::string> names{kOwnBase};
  if (hasModel(options)) names.emplace_back(kNeuralBase);
  if (!limits.keepComponents && findOidn(options.oidnLibrary)) names.emplace_back(kOidnBase);
  if (names.size() == 1) return {kOwnBase, "is all that there is"};
  MethodChoice best{kOwnBase, "promises the least error"};
  double least = std::numeric_limits<double>::infinity();
  for (const std::string& name : names) {
    BaseOptions named = options;
    named.name = name;
    const double error = expectedErrorOf(named, noisy, plan, limits);
    if (std::isinf(error)) best.why = "promises the least error of those that fit the memory";
    if (!(error < least)) continue;
    best.name = name;
    least = error;
  }
  return best;
}

}  // namespace fathom::cli
