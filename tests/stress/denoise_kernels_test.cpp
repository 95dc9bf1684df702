// The kernels of the deep filter and of the gates and mixes against their twins, on values at the ends of what files hold.
#include <gtest/gtest.h>

#include <atomic>

#include "deep/feature_prefilter.h"
#include "deep/filter_passes.h"
#include "deep/gate.h"
#include "deep/guide.h"
#include "deep/still.h"
#include "flat/bilateral.h"
#include "flat/mix_kernel.h"
#include "tests/reference/bilateral.h"
#include "tests/reference/gate.h"
#include "tests/reference/joint_filter.h"
#include "tests/reference/mix.h"
#include "tests/reference/simd_targets.h"
#include "tests/stress/extreme_noisy.h"
#include "tests/stress/record.h"

namespace fathom::deep {
namespace {

using stress::Draw;
using stress::extremeDeep;
using stress::ExtremeParams;
using stress::record;

// All that the filter of a frame reads, made as `denoise` makes it.
struct Prepared {
  DeepImage image;
  DenoisePlan plan;
  DenoiseData data;
  FilterPass pass;
  std::vector<ComponentGuide> guides;
  std::vector<Buffer<float>> gradients;
  JointFilterInput input;

  Prepared(const ExtremeParams& params, FilterKind kind) : image(extremeDeep(params)) {
    plan = stress::planFor(image, {.filter = kind});
    data = prepareColours(image, plan.inputs);
    pass = filterPasses(plan).front();
    const Buffer<uint8_t> none(image.pixels(), 0);
    prepareFeatures(image, plan.inputs, none, data);
    for (const DenoiseComponent& component : data.components)
      guides.push_back(colourGuide(data, component, pass.guideBorder()));
    input = {data.width, data.height, data.rowPhase, data.offsets, {}, {}, nullptr};
    for (const Feature* feature : {&data.albedo, &data.normal, &data.depth}) {
      std::vector<Buffer<float>> squared = squaredGradients(data, *feature, none);
      for (size_t c = 0; c < squared.size(); ++c) {
        input.features.push_back({feature->value[c].data(), feature->variance[c].data(), squared[c].data()});
        gradients.push_back(std::move(squared[c]));
      }
    }
    for (size_t c = 0; c < guides.size(); ++c)
      input.components.push_back({data.components[c].data.data(),
                                  {&guides[c].value[0], &guides[c].value[1]},
                                  {&guides[c].variance, &guides[c].variance}});
  }
};

// The largest value of each of the 8 planes of a component's data.
std::array<double, 8> largestOf(const FilterComponent& component, size_t bins) {
  std::array<double, 8> largest{};
  for (size_t i = 0; i < 8 * bins; ++i) largest[i % 8] = std::max(largest[i % 8], std::fabs(double(component.data[i])));
  return largest;
}

// The worst error of the sums, relative to the sum of absolute values, beyond the most that weights come to which count as
// 0: those below exp(-87).
double worstOfJointFilter(const JointFilterInput& input, const JointFilterParams& params) {
  const reference::JointSums twin = reference::jointFilter(input, params);
  const unsigned all = (1u << input.components.size()) - 1;
  std::vector<std::array<double, 8>> nothing;
  for (const FilterComponent& component : input.components) {
    nothing.push_back(largestOf(component, size_t(input.offsets[input.width * input.height])));
    for (double& n : nothing.back()) n = n * 1.7e-36 + 1e-38;  // of a hundred neighbours
  }
  std::atomic<double> worst = 0;
  jointFilter(
      input, params, [&](const Box&) { return all; },
      [&](const FilterTile& tile) {
        double mine = 0;
        size_t i = 0;
        for (int y = tile.box.y0; y < tile.box.y1; ++y) {
          const uint64_t* row = input.offsets + size_t(y) * size_t(input.width);
          for (uint64_t b = row[tile.box.x0]; b < row[tile.box.x1]; ++b, ++i)
            for (size_t c = 0; c < input.components.size(); ++c)
              for (size_t k = 0; k < size_t(params.candidates); ++k)
                for (size_t h = 0; h < 2; ++h) {
                  const auto& expected = twin.at(b, c, k, h);
                  const float* sums = tile.at(i, int(c), int(k)) + 4 * h;
                  for (size_t j = 0; j < 4; ++j) {
                    const double error = std::fabs(double(sums[j]) - expected.sum[j]) - nothing[c][4 * h + j];
                    EXPECT_TRUE(std::isfinite(sums[j]));
                    if (error > 0) mine = std::max(mine, error / expected.magnitude[j]);
                  }
                  const double own = std::fabs(double(tile.own(i, int(c), int(k))[h]) - expected.own);
                  if (own > nothing[c][4 * h + 3]) mine = std::max(mine, own / expected.magnitude[3]);
                }
        }
        for (double before = worst; mine > before && !worst.compare_exchange_weak(before, mine);) {
        }
      });
  return worst;
}

// 1e-4 of what is added up: weights are exp(-d), d <= 87, with a rounding error of d of a few 1e-7.
TEST(StressDenoiseKernels, TheJointFilterEqualsItsTwin) {
  constexpr double kBound = 1e-4;
  constexpr std::pair<FilterKind, const char*> kKinds[] = {
      {FilterKind::Own, "own"}, {FilterKind::Paper, "paper"}, {FilterKind::Rdfc, "rdfc"}};
  for (int round = 0; round < stress::rounds(); ++round)
    for (const auto& [kind, name] : kKinds)
      for (const auto& [width, height] : {std::pair{19, 15}, {1, 1}, {1, 23}, {37, 1}})
        for (const float largest : {6e4f, 9e14f}) {
          const Prepared frame({.width = width,
                                .height = height,
                                .seed = unsigned(17 * round + width),
                                .largest = largest,
                                .components = width != 37,
                                .features = height != 23},
                               kind);
          double worst = 0;
          const auto look = [&] {
            for (JointFilterParams bank : frame.pass.banks) {
              bank.radius = std::min(bank.radius, 4);  // the twin is slow
              worst = std::max(worst, worstOfJointFilter(frame.input, bank));
            }
          };
          if (round == 0 && width == 37)
            forSimdTargets(look);
          else
            look();
          record(std::string("deep filter, ") + name, "values, alphas, depths, variances: sums against the twin", worst,
                 kBound);
          EXPECT_LT(worst, kBound) << name << " " << width << "x" << height << " up to " << largest;
        }
}

// What is made of channels before anything is filtered, in double precision.
TEST(StressDenoiseKernels, ColoursAndFeaturesAreReadAsTheirFormulasHaveIt) {
  constexpr double kBound = 2e-6;
  double worst = 0, worstDepth = 0;
  for (int round = 0; round < 2 * stress::rounds(); ++round) {
    const Prepared frame({.width = 24, .height = 20, .seed = unsigned(100 + round), .largest = 9e14f}, FilterKind::Own);
    const DeepImage& image = frame.image;
    const auto at = [&](const std::string& name, size_t b) { return double(image.get(name)[b]); };
    for (size_t p = 0; p < image.pixels(); ++p) {
      double passed = 1;
      for (size_t b = image.offsets[p]; b < image.offsets[p + 1]; ++b) {
        const double alpha = at("A", b), share = passed * alpha;
        passed *= 1 - alpha;
        ASSERT_EQ(frame.data.weight[b] > 0, float(share) >= kLeastShare) << share;
        const double z = std::min(at("Z", b), 1e30);
        worstDepth = std::max(worstDepth, std::fabs(double(frame.data.depth.value[0][b]) - std::log(z)));
        if (!(frame.data.weight[b] > 0)) continue;
        worst = std::max(worst, std::fabs(double(frame.data.weight[b]) / share - 1));
        for (size_t h = 0; h < 2; ++h) {
          const std::string half = fmt::format("half{}.", h);
          const double all = at("half0.samples", b) + at("half1.samples", b);
          const double w = all > 0 ? share * 2 * at(half + "samples", b) / all : 0;
          for (size_t c = 0; c < 3; ++c) {
            const std::string rgb(1, "RGB"[c]);
            const double albedo = at(fmt::format("{}albedo.{}", half, rgb), b) / alpha;
            const double expected =
                w * at(fmt::format("{}diffuse.{}", half, rgb), b) / alpha / (albedo + double(kAlbedoOffset));
            const float found = frame.data.components[0].data[8 * b + 4 * h + c];
            const float foundWeight = frame.data.components[0].data[8 * b + 4 * h + 3];
            if (w > 0 && foundWeight == 0) {  // only where something is beyond what counts as finite
              double most = 0;
              for (const char* name : {"diffuse.", "specular.", ""})
                for (const char* of : {"", "half0.", "half1."})
                  for (const char* channel : {"R", "G", "B"})
                    most = std::max(most, std::fabs(at(fmt::format("{}{}{}", of, name, channel), b)) / alpha / 0.03);
              ASSERT_GT(most, 0.9e15);
              continue;
            }
            worst = std::max(worst, std::fabs(double(found) - expected) / (std::fabs(expected) + 1e-36));
            worst = std::max(worst, std::fabs(double(foundWeight) - w) / (w + 1e-36));
          }
        }
      }
    }
  }
  record("deep filter, reading", "values, alphas, halves of any counts", worst, kBound);
  record("deep filter, reading", "depths 1e-6 to infinite: log Z", worstDepth, 1e-5);
  EXPECT_LT(worst, kBound);
  EXPECT_LT(worstDepth, 1e-5);
}

// Bins of a gate with filtered values, residuals and variances over all magnitudes.
struct GateFrame {
  DenoiseData data;
  Buffer<uint64_t> offsets;
  Buffer<GateBin> bins;
  Buffer<uint8_t> still;

  GateFrame(int width, int height, unsigned seed, double largest) {
    Draw draw(seed);
    const size_t pixels = size_t(width) * size_t(height);
    offsets = Buffer<uint64_t>(pixels + 1, uint64_t(0));
    for (size_t p = 0; p < pixels; ++p) offsets[p + 1] = offsets[p] + draw.below(4);
    data.width = width;
    data.height = height;
    data.offsets = offsets.data();
    bins = Buffer<GateBin>(offsets[pixels]);
    still = Buffer<uint8_t>(pixels, 0);
    Buffer<float>& depth = data.depth.value.emplace_back(bins.size());
    const double magnitude = draw.power(1e-20, largest);
    for (size_t b = 0; b < bins.size(); ++b) {
      depth[b] = std::log(draw.of({1e-6f, std::nextafter(1e-6f, 1.0f), 1, 1.01f, 1e9f, 1e30f}));
      bins[b] = {};
      bins[b].samples = draw.of({0, 1, 2, 64, 10000});
      for (size_t c = 0; c < 3; ++c) {
        const double f = draw.below(3) ? magnitude * draw.uniform(0.5, 1.5) : draw.power(1e-45, largest);
        bins[b].filtered[c] = float(f);
        bins[b].residual[c] = float(f * draw.normal() * double(draw.of({0, 1e-3f, 0.3f, 10})));
        bins[b].variance[c] = float(draw.below(4) ? f * f * draw.power(1e-6, 10) : double(draw.of({0, 1e-40f, 1e19f})));
      }
    }
  }
};

// The gated value's error of the larger of noisy and filtered value, but for what is a millionth of the frame's level: squares
// of less than 1e-19 are no numbers any more.
TEST(StressDenoiseKernels, TheGateOnBinsEqualsItsTwin) {
  constexpr double kBound = 1e-4;
  double worst = 0;
  for (int round = 0; round < 6 * stress::rounds(); ++round)
    for (const double largest : {6e4, 1e9, 1e15}) {
      const GateFrame frame(round % 3 == 0 ? 1 : 15, 13, unsigned(round), largest);
      const float level = 0.5f;
      const auto look = [&] {
        const Buffer<flat::GateVerdict> verdicts = gate(frame.data, frame.bins, frame.still, level);
        for (int y = 0; y < frame.data.height; ++y)
          for (int x = 0; x < frame.data.width; ++x) {
            const size_t p = size_t(y) * size_t(frame.data.width) + size_t(x);
            for (size_t b = frame.offsets[p]; b < frame.offsets[p + 1]; ++b) {
              const double k = double(verdicts[b].k);
              ASSERT_TRUE(k >= 0 && k <= 1) << k;
              const double wrong = std::fabs(k - reference::gate(frame.data, frame.bins, x, y, b, level));
              for (size_t c = 0; c < 3; ++c) {
                const double residual = std::fabs(double(frame.bins[b].residual[c]));
                const double value = std::fabs(double(frame.bins[b].filtered[c])) + residual;
                worst = std::max(worst, wrong * residual / (value + 1e-6 * double(level)));
              }
            }
          }
      };
      if (round == 0)
        forSimdTargets(look);
      else
        look();
    }
  record("gate on bins", "values to 1e15, variance 0 and huge, 0 to 10,000 samples", worst, kBound);
  EXPECT_LT(worst, kBound);
}

// The share times what both estimates differ by, of the larger of these.
TEST(StressDenoiseKernels, TheMixEqualsItsTwin) {
  constexpr double kBound = 1e-4;
  double worst = 0;
  const auto look = [&](unsigned seed, double largest) {
    Draw draw(seed);
    const double magnitude = draw.power(1e-15, largest);
    for (int i = 0; i < 200; ++i) {
      std::vector<reference::MixNeighbour> all;
      for (size_t n = draw.below(50); n > 0; --n) {
        flat::MixSample sample = {};
        sample.samples = draw.of({0, 1, 2, 64, 10000});
        for (size_t c = 0; c < 3; ++c) {
          const double f = draw.below(3) ? magnitude * draw.uniform(0.5, 1.5) : draw.power(1e-45, largest);
          sample.mean[c] = float(f);
          sample.difference[c] = float(f * draw.normal() * double(draw.of({0, 1e-3f, 0.3f, 1})));
          sample.residual[c] = float(f * draw.normal() * double(draw.of({0, 1e-3f, 0.3f, 10})));
          sample.variance[c] =
              float(draw.below(4) ? f * f * draw.power(1e-6, 10) : double(draw.of({0, 1e-40f, 1e19f})));
        }
        all.push_back({sample, float(draw.uniform(0.01, 1))});
      }
      flat::MixNeighbours neighbours;
      for (const auto& [sample, reach] : all)
        if (sample.samples > 0) neighbours.add(sample, reach);
      const flat::MixSample here = all.empty() ? flat::MixSample() : all[all.size() / 2].sample;
      const flat::MixParams params{draw.of({0, 0.4f, 1}), 5};
      const double share = double(mixShare(here, neighbours, params, 1e-4f));
      ASSERT_TRUE(share >= 0 && share <= 1) << share;
      const double wrong = std::fabs(share - reference::mixShare(here, all, params, 1e-4));
      for (size_t c = 0; c < 3; ++c) {
        const double difference = std::fabs(double(here.difference[c]));
        worst = std::max(worst, wrong * difference / (std::fabs(double(here.mean[c])) + difference + 1e-6));
      }
    }
  };
  for (int round = 0; round < 4 * stress::rounds(); ++round)
    for (const double largest : {6e4, 1e9, 1e15}) {
      if (round == 0)
        forSimdTargets([&] { look(1, largest); });
      else
        look(unsigned(round), largest);
    }
  record("mix of two estimates", "values to 1e15, variance 0 and huge, 0 to 10,000 samples", worst, kBound);
  EXPECT_LT(worst, kBound);
}

}  // namespace
}  // namespace fathom::deep
