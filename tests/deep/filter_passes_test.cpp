// The published filters that ours is compared with, and passes of several banks.
#include "deep/filter_passes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/reference/random_deep.h"
#include "tests/reference/rendered_frame.h"

namespace fathom::deep {
namespace {

using reference::binError;
using reference::flatError;
using reference::RenderedFrame;
using reference::renderFrame;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr FilterKind kPublished[] = {FilterKind::Paper, FilterKind::Rdfc};

DenoisePlan planFor(const DeepImage& image, const DenoiseParams& params) {
  std::vector<std::string> names;
  for (const Channel& channel : image.channels) names.push_back(channel.name);
  return {findDenoiseInputs(names, image.attributes), params, meanLevel(image)};
}

DeepImage run(const DeepImage& image, FilterKind filter) {
  return denoise(image.copy(), planFor(image, {.filter = filter}));
}

void expectFinite(const DeepImage& image) {
  for (const char* name : {"R", "G", "B"})
    for (const float v : image.get(name)) ASSERT_TRUE(std::isfinite(v)) << name;
}

void dropHalves(DeepImage& image) {
  std::erase_if(image.channels, [](const Channel& channel) { return channel.name.starts_with("half"); });
}

TEST(FilterPasses, AreWithinWhatTheKernelTakes) {
  for (const FilterKind filter : {FilterKind::Own, FilterKind::Paper, FilterKind::Rdfc})
    for (const Quality quality : {Quality::Fast, Quality::Balanced, Quality::Best})
      for (const bool halves : {false, true}) {
        DenoisePlan plan;
        plan.params = {.quality = quality, .filter = filter};
        plan.inputs.halves = halves;
        const std::vector<FilterPass> passes = filterPasses(plan);
        EXPECT_LE(passes.size(), halves ? 2u : 1u);
        for (const FilterPass& pass : passes) {
          EXPECT_LE(pass.candidates(), kMaxPassCandidates);
          for (const JointFilterParams& bank : pass.banks) {
            EXPECT_TRUE(bank.candidates >= 1 && bank.candidates <= kMaxCandidates);
            EXPECT_TRUE(bank.colourCandidates >= 0 && bank.colourCandidates <= std::min(2, bank.candidates));
            EXPECT_TRUE(bank.patchRadius >= 0 && bank.patchRadius <= kMaxPatchRadius);
            EXPECT_EQ(bank.crossed, halves);
          }
        }
      }
}

TEST(FilterPasses, TheLargestBankSetsTheReachOfAPass) {
  JointFilterParams wide, patchy;
  wide.radius = 9;
  wide.patchRadius = 0;
  wide.candidates = 1;
  patchy.radius = 7;
  patchy.patchRadius = 4;
  patchy.candidates = 2;
  const FilterPass pass{{wide, patchy}, {}};
  EXPECT_EQ(pass.candidates(), 3);
  EXPECT_EQ(pass.radius(), 9);
  EXPECT_EQ(pass.guideBorder(), 11);
}

TEST(FilterPasses, PublishedFiltersLowerTheError) {
  const RenderedFrame frame = renderFrame();
  const double flat = flatError(frame.noisy, frame.truth), bins = binError(frame.noisy, frame.truth);
  for (const FilterKind filter : kPublished)
    for (const bool halves : {true, false}) {
      DeepImage noisy = frame.noisy.copy();
      if (!halves) dropHalves(noisy);
      const DeepImage out = run(noisy, filter);
      expectFinite(out);
      EXPECT_LT(flatError(out, frame.truth), (halves ? 0.35 : 0.6) * flat) << int(filter) << halves;
      EXPECT_LT(binError(out, frame.truth), (halves ? 0.35 : 0.6) * bins) << int(filter) << halves;
    }
}

TEST(FilterPasses, PublishedFiltersHaveNoGate) {
  const DeepImage noisy = renderFrame().noisy;
  for (const FilterKind filter : kPublished)
    EXPECT_EQ(reference::difference(denoise(noisy.copy(), planFor(noisy, {.gate = true, .filter = filter})),
                                    denoise(noisy.copy(), planFor(noisy, {.gate = false, .filter = filter}))),
              "");
}

TEST(FilterPasses, FramesSmallerThanAWindow) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 2}, {2, 1}, {1, 33}, {40, 1}, {3, 3}})
    for (const FilterKind filter : kPublished)
      for (const bool halves : {true, false}) {
        DeepImage noisy =
            renderFrame({.width = width, .height = height, .empty = [](int, int) { return false; }}).noisy;
        if (!halves) dropHalves(noisy);
        const DeepImage out = run(noisy, filter);
        EXPECT_EQ(out.samples(), noisy.samples());
        expectFinite(out);
      }
}

// FIRST and SECOND of Rdfc find no one there, THIRD, of another bank, does.
TEST(FilterPasses, APixelThatIsNotFiniteIsFilledAcrossBanks) {
  // So little noise that colour weights are nothing.
  const RenderedFrame frame = renderFrame({.noise = [](int, int) { return 0.02f; }});
  for (const FilterKind filter : kPublished)
    for (const int x : {0, 20, 47}) {
      DeepImage noisy = frame.noisy.copy();
      const size_t pixel = size_t(21) * 48 + size_t(x);
      for (Channel& channel : noisy.channels)
        for (const char* colours : {"R", "G", "B", "diffuse.", "specular.", "half"})
          if (channel.name.starts_with(colours) && channel.type != PixelType::Uint)
            for (size_t b = noisy.offsets[pixel]; b < noisy.offsets[pixel + 1]; ++b) channel.values[b] = kNan;
      const DeepImage out = denoise(std::move(noisy), planFor(frame.noisy, {.filter = filter}));
      expectFinite(out);
      for (const char* name : {"R", "G", "B"})
        for (size_t b = out.offsets[pixel]; b < out.offsets[pixel + 1]; ++b)
          EXPECT_NEAR(out.get(name)[b], frame.truth.get(name)[b], 0.4f * frame.truth.get(name)[b])
              << int(filter) << " at " << x;
    }
}

// One opaque bin with halves, and candidates of it that a test makes up.
struct OnePixel {
  uint64_t offsets[2] = {0, 1};
  DenoiseData data;
  GuideVariance variance;
  Buffer<uint8_t> still{1, 0};

  OnePixel(float half0, float half1) {
    data.width = data.height = 1;
    data.offsets = offsets;
    data.halves = true;
    data.weight = Buffer<float>(1, 1.0f);
    DenoiseComponent& component = data.components.emplace_back();
    component.data = Buffer<float>(8, 1.0f);
    std::fill_n(component.data.data(), 3, half0);
    std::fill_n(component.data.data() + 4, 3, half1);
  }

  // Adds a bank of one candidate with those filtered halves and this sum of weights.
  void add(int first, float half0, float half1, float weight, Candidates& candidates) const {
    const float a = half0 * weight, b = half1 * weight;
    const float sums[8] = {a, a, a, weight, b, b, b, weight}, own[2] = {0.25f * weight, 0.25f * weight};
    addCandidates(data, data.components[0], variance, {{0, 0, 1, 1}, sums, own, 1, 1, 1}, 0, first, still, candidates);
  }
};

TEST(Selection, EstimatesOfOneCandidateByHand) {
  const OnePixel pixel(1, 2);
  Candidates stein(pixel.data, 1, {ErrorEstimate::Stein, false});
  Candidates other(pixel.data, 1, {ErrorEstimate::OtherHalf, false});
  pixel.add(0, 1.25f, 1.5f, 2, stein);
  pixel.add(0, 1.25f, 1.5f, 2, other);
  const float between = 0.25f * 0.25f / 4;  // variance of the filtered mean
  EXPECT_FLOAT_EQ(stein.error[0].row(0)[0], 3 * ((0.0625f + 0.25f) / 2 - (1 - 2 * 0.25f) * 0.5f - between));
  EXPECT_FLOAT_EQ(other.error[0].row(0)[0], 3 * ((0.5625f + 0.25f) / 2 - 2 * 0.25f - between));
}

TEST(Selection, WithoutHalvesTheVarianceIsTold) {
  OnePixel pixel(1, 0);
  pixel.data.halves = false;
  pixel.data.components[0].data[7] = 0;
  for (flat::Padded& plane : pixel.variance.value) {
    plane = flat::Padded(1, 1, 0);
    plane.row(0)[0] = 0.5f;
  }
  Candidates candidates(pixel.data, 1, {});
  pixel.add(0, 1.25f, 0, 2, candidates);
  EXPECT_FLOAT_EQ(candidates.error[0].row(0)[0], 3 * (0.0625f - (1 - 2 * 0.25f) * 0.5f));
}

TEST(Selection, AHalfWithoutSamplesIsTheOther) {
  OnePixel pixel(1, 0);
  pixel.data.components[0].data[7] = 0;
  Candidates candidates(pixel.data, 1, {ErrorEstimate::Stein, false});
  pixel.add(0, 1.25f, 1.5f, 2, candidates);
  EXPECT_FLOAT_EQ(candidates.error[0].row(0)[0], 3 * ((0.0625f + 0.25f) / 2 - 0.25f * 0.25f / 4));
}

TEST(Selection, BlendsByTheSquaresOfErrors) {
  const OnePixel pixel(1, 2);
  Candidates candidates(pixel.data, 2, {});
  pixel.add(0, 1, 1, 1, candidates);
  pixel.add(1, 2, 2, 1, candidates);
  candidates.error[0].row(0)[0] = 1;
  candidates.error[1].row(0)[0] = 2;
  EXPECT_FLOAT_EQ(blendCandidates(pixel.data, pixel.still, std::move(candidates), 1, 0).value[0], (4 * 1 + 2) / 5.0f);
}

// Of a pixel that is half covered: the halves' flattened values, what their difference tells, and their own shares.
TEST(Selection, PilotsAndAnswersByHand) {
  OnePixel pixel(1, 2);
  pixel.data.weight[0] = 0.5f;
  Candidates candidates(pixel.data, 1, {}, {true, true});
  pixel.add(0, 1, 2, 1, candidates);
  const Blend blend = blendCandidates(pixel.data, pixel.still, std::move(candidates), 1, 1);
  EXPECT_FLOAT_EQ(blend.pilot.value[0].value[0].row(0)[0], 0.5f);
  EXPECT_FLOAT_EQ(blend.pilot.variance.value[0].row(0)[0], 0.5f * 0.5f * 0.5f);
  EXPECT_FLOAT_EQ(blend.answer.difference[0][0], -0.5f);
  EXPECT_FLOAT_EQ(blend.answer.share[1][0], 0.25f);
}

TEST(Selection, TheBestCandidateOfAnyBankIsTakenWhole) {
  const OnePixel pixel(1, 2);
  const float good[2] = {1.45f, 1.55f}, bad[2] = {4, 4};
  for (const int best : {0, 1}) {
    Candidates candidates(pixel.data, 2, {ErrorEstimate::Stein, true});
    pixel.add(0, best == 0 ? good[0] : bad[0], best == 0 ? good[1] : bad[1], 1, candidates);
    pixel.add(1, best == 1 ? good[0] : bad[0], best == 1 ? good[1] : bad[1], 1, candidates);
    EXPECT_FLOAT_EQ(blendCandidates(pixel.data, pixel.still, std::move(candidates), 1, 0).value[0], 1.5f) << best;
  }
}

TEST(Selection, ABankThatFindsNothingTakesWhatAnotherFound) {
  const OnePixel pixel(1, 2);
  for (const int silent : {0, 1})
    for (const float nothing : {0.0f, 1e-13f}) {
      Candidates candidates(pixel.data, 2, {});
      pixel.add(silent, 9, 9, nothing, candidates);
      pixel.add(1 - silent, 1.5f, 1.5f, 1, candidates);
      EXPECT_FLOAT_EQ(blendCandidates(pixel.data, pixel.still, std::move(candidates), 1, 0).value[0], 1.5f) << silent;
    }
}

}  // namespace
}  // namespace fathom::deep
