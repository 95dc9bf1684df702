// How bins are made to add up to a guide, against its formula in double precision on values at the ends of what files hold.
#include "deep/consistency.h"

#include <gtest/gtest.h>

#include "flat/mix.h"
#include "flat/noise.h"
#include "tests/reference/noisy_flat.h"
#include "tests/stress/extreme_noisy.h"
#include "tests/stress/record.h"

namespace fathom::deep {
namespace {

using stress::extremeDeep;
using stress::record;

// The expected squared error of a bin's colour.
double errorOf(const flat::GateVerdict& gate, size_t c, double colour, const ConsistencyParams& p, double least) {
  const double left = 1 - double(gate.k);
  return double(p.relative) * colour * colour + double(p.noise) * double(gate.noise[c]) +
         left * left * double(gate.bias2[c]) + least;
}

TEST(StressConsistency, EqualsItsFormula) {
  constexpr double kBound = 1e-5;
  double worst = 0;
  for (int round = 0; round < 4 * stress::rounds(); ++round)
    for (const auto& [width, height] : {std::pair{1, 1}, {1, 19}, {23, 1}, {18, 14}})
      for (const float largest : {6e4f, 9e14f}) {
        const DeepImage image =
            extremeDeep({.width = width, .height = height, .seed = unsigned(round), .largest = largest});
        const DenoisePlan plan = stress::planFor(image);
        DenoiseData data = prepareColours(image, plan.inputs);
        const BaseGuide guide = makeGuide(guideInput(image, plan, false), {reference::boxDenoiser(), {}, {}}, plan);
        stress::Draw draw(unsigned(round) + 3);
        Buffer<float> colours(3 * data.bins());
        Buffer<flat::GateVerdict> gates(data.bins());
        Buffer<uint8_t> still(image.pixels(), 0);
        for (uint8_t& s : still) s = draw.below(5) == 0;
        for (size_t b = 0; b < data.bins(); ++b) {
          gates[b].k = float(draw.uniform());
          for (size_t c = 0; c < 3; ++c) {
            const double light = draw.power(1e-44, double(largest));
            colours[3 * b + c] = float(draw.below(8) ? light : -light);
            gates[b].noise[c] = float(draw.below(4) ? std::min(light * light * draw.uniform(), 1e30) : 0);
            gates[b].bias2[c] = float(draw.below(2) ? std::min(light * light * draw.uniform(), 1e30) : 0);
          }
        }
        const Buffer<float> before = colours.copy();
        makeConsistent(image, data, guide, gates, still, plan.level, colours);
        // The frame as it is: bins without a say show what they hold.
        flat::Image now{image.dataWindow, image.displayWindow, {}, {}};
        const auto alpha = image.get("A");
        for (size_t c = 0; c < 3; ++c) {
          Buffer<float>& out = now.add(flat::kRgbNames[c]).values;
          for (size_t p = 0; p < image.pixels(); ++p) {
            double sum = 0, passed = 1;
            for (size_t b = image.offsets[p]; b < image.offsets[p + 1]; ++b) {
              const float shown = image.get(flat::kRgbNames[c])[b];
              sum += data.weight[b] > 0 ? double(data.weight[b]) * double(before[3 * b + c])
                                        : passed * double(finiteOrZero(shown));
              passed *= 1 - double(alpha[b]);
            }
            out[p] = float(sum);
          }
        }
        flat::Noise noise = flat::noiseOf(guide.noisy);
        noise.level = plan.level;
        const ConsistencyParams& params = guide.consistency;
        const flat::Image target = flat::mixed(guide.noisy, noise, now, guide.flattened, params.mix);
        const double least = 4e-6 * double(plan.level) * double(plan.level);
        for (size_t p = 0; p < image.pixels(); ++p)
          for (size_t c = 0; c < 3; ++c) {
            double mean = 0, square = 0, error = 0, sizes = 0;
            for (size_t b = image.offsets[p]; b < image.offsets[p + 1]; ++b) {
              const double w = data.weight[b], value = before[3 * b + c];
              mean += w * value;
              square += w * value * value;
              sizes = std::max(sizes, std::fabs(value));
              error += w * w * errorOf(gates[b], c, value, params, least);
            }
            const double samples = std::max(double(noise.samples[p]), 1.0);
            const double all = error + double(params.alphaNoise) * std::max(0.0, square - mean * mean) / samples;
            const double change = double(target.planes[c].values[p]) - double(now.planes[c].values[p]);
            sizes = std::max(
                {sizes, std::fabs(double(target.planes[c].values[p])), std::fabs(double(now.planes[c].values[p]))});
            for (size_t b = image.offsets[p]; b < image.offsets[p + 1]; ++b) {
              const double value = before[3 * b + c], w = data.weight[b];
              const float found = colours[3 * b + c];
              if (still[p] || !(w > 0) || !(error > 0)) {
                ASSERT_TRUE(stress::sameBits(found, before[3 * b + c]));
                continue;
              }
              const double v = errorOf(gates[b], c, value, params, least),
                           most = double(params.mostDeviations) * std::sqrt(v);
              if (std::fabs(change / all) > 0.9e15) continue;  // what cannot be told is left
              const double moved =
                  std::max(value + std::clamp(v * w * change / all, -most, most), std::min(value, 0.0));
              ASSERT_TRUE(std::isfinite(found));
              // The sums' rounding is that of their largest term, and moves the bin as a change of the sum does.
              const double gain = std::max(1.0, v * w / all);
              worst = std::max(worst, std::fabs(double(found) - moved) / (gain * sizes + 1e-3 * double(plan.level)));
            }
          }
      }
  record("consistency of bins with a guide", "values, alphas, variance 0 and huge", worst, kBound);
  EXPECT_LT(worst, kBound);
}

}  // namespace
}  // namespace fathom::deep
