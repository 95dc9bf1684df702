// The joint filter against its twin, over shapes of frames, windows, features and instruction sets.
#include "deep/joint_filter.h"

#include <gtest/gtest.h>

#include <atomic>
#include <mutex>

#include "tests/reference/filter_frame.h"
#include "tests/reference/joint_filter.h"
#include "tests/reference/simd_targets.h"

namespace fathom::deep {
namespace {

using reference::FrameShape;
using reference::RandomFrame;

// Calls look(bin, c, k, sums, own) with the kernel's values for all bins and those components that `active` asks for.
template <class Look>
void filter(const JointFilterInput& input, const JointFilterParams& params, unsigned active, const Look& look) {
  std::vector<std::atomic<int>> seen(size_t(input.width) * size_t(input.height));
  jointFilter(
      input, params, [&](const Box&) { return active; },
      [&](const FilterTile& tile) {
        size_t i = 0;
        EXPECT_EQ(tile.active, active);
        for (int y = tile.box.y0; y < tile.box.y1; ++y)
          for (int x = tile.box.x0; x < tile.box.x1; ++x) {
            const size_t pixel = size_t(y) * size_t(input.width) + size_t(x);
            ++seen[pixel];
            for (size_t b = size_t(input.offsets[pixel]); b < size_t(input.offsets[pixel + 1]); ++b, ++i)
              for (int c = 0, from = 0; c < int(input.components.size()); ++c) {
                if (!(active >> c & 1)) continue;
                for (int k = 0; k < params.candidates; ++k) look(b, c, k, tile.at(i, from, k), tile.own(i, from, k));
                ++from;
              }
          }
      });
  for (const auto& count : seen) ASSERT_EQ(count, 1);
}

// Every sum to 1e-4 of what was added up.
void expectLikeTwin(const JointFilterInput& input, const JointFilterParams& params, unsigned active) {
  const reference::JointSums twin = reference::jointFilter(input, params);
  std::atomic<double> worst = 0;
  filter(input, params, active, [&](size_t b, int c, int k, const float* sums, const float* own) {
    double error = 0;
    for (size_t h = 0; h < 2; ++h) {
      const auto& expected = twin.at(b, size_t(c), size_t(k), h);
      for (size_t i = 0; i < 4; ++i)
        error = std::max(error, std::fabs(double(sums[4 * h + i]) - expected.sum[i]) / (expected.magnitude[i] + 1e-20));
      error = std::max(error, std::fabs(double(own[h]) - expected.own) / (expected.magnitude[3] + 1e-20));
    }
    double before = worst;
    while (!(error <= before) && !worst.compare_exchange_weak(before, error)) {
    }
  });
  EXPECT_LT(worst, 1e-4);
}

void expectLikeTwin(const FrameShape& shape, const JointFilterParams& params, unsigned seed = 1) {
  const RandomFrame frame(shape, params, seed);
  const unsigned all = (1u << shape.components) - 1;
  for (unsigned active = 1; active <= all; ++active) expectLikeTwin(frame.input(), params, active);
}

TEST(JointFilter, EqualsItsTwinForEveryWidth) {
  forSimdTargets([] {
    for (int width = 1; width <= 70; ++width) {
      SCOPED_TRACE(width);
      expectLikeTwin({.width = width, .height = 4, .mostBins = 2, .components = 1 + width % 2, .triples = width % 3},
                     {.radius = 2, .patchRadius = 1}, unsigned(width));
    }
  });
}

TEST(JointFilter, EqualsItsTwinForHeightsAndPhases) {
  for (const int height : {1, 2, 15, 16, 17, 33, 40})
    for (const int phase : {0, 5, 15, -1, -16, -37, 1000003}) {
      SCOPED_TRACE(std::to_string(height) + " from " + std::to_string(phase));
      expectLikeTwin({.width = 5, .height = height, .rowPhase = phase, .mostBins = 2}, {.radius = 3, .patchRadius = 1});
    }
}

TEST(JointFilter, EqualsItsTwinForWindowsAndPatches) {
  forSimdTargets([] {
    for (int radius = 1; radius <= 5; ++radius)
      for (int patch = 0; patch <= 3; ++patch) {
        SCOPED_TRACE(std::to_string(radius) + ", " + std::to_string(patch));
        expectLikeTwin({.width = 34, .height = 5, .mostBins = 2, .components = 1},
                       {.radius = radius, .patchRadius = patch});
      }
  });
  expectLikeTwin({.width = 35, .height = 18, .mostBins = 1}, {.radius = 6, .patchRadius = 2});
}

TEST(JointFilter, EqualsItsTwinForAnyNumberOfBins) {
  forSimdTargets([] {
    for (const int most : {0, 1, 2, 7, 40}) {
      SCOPED_TRACE(most);
      const int width = most > 10 ? 9 : 37;
      expectLikeTwin({.width = width, .height = 6, .mostBins = most}, {.radius = 2, .patchRadius = 1}, unsigned(most));
    }
  });
}

TEST(JointFilter, EqualsItsTwinForEveryBank) {
  forSimdTargets([] {
    for (int candidates = 1; candidates <= 3; ++candidates)
      for (int colour = 0; colour <= std::min(2, candidates); ++colour)
        for (int components = 1; components <= 2; ++components)
          for (const bool crossed : {true, false}) {
            SCOPED_TRACE(testing::Message() << candidates << colour << components << crossed);
            JointFilterParams params{
                .radius = 2, .patchRadius = 1, .candidates = candidates, .colourCandidates = colour};
            params.kFeature = {0.7f, 2.0f, colour == 1 ? 2.0f : 1.3f};
            params.crossed = crossed;
            expectLikeTwin({.components = components, .triples = colour, .sharedVariance = crossed}, params);
          }
  });
}

// The prefilter's parameters: a small k makes small errors of the distances large ones of the weights.
TEST(JointFilter, EqualsItsTwinForSmallK) {
  JointFilterParams params{.radius = 2, .patchRadius = 1, .candidates = 1, .colourCandidates = 1};
  params.kColour = {1.5f, 1.5f};
  params.kFeature = {0.05f, 0.05f, 0.05f};
  params.crossed = false;
  forSimdTargets([&] {
    expectLikeTwin({.width = 40, .height = 20, .mostBins = 2, .components = 1, .triples = 0, .sharedVariance = false},
                   params);
  });
}

TEST(JointFilter, ATileThatNothingAsksForIsConsumedAllTheSame) {
  const JointFilterParams params;
  const RandomFrame frame({.width = 70, .height = 40}, params, 1);
  size_t pixels = 0;
  std::mutex mutex;
  jointFilter(
      frame.input(), params, [](const Box&) { return 0u; },
      [&](const FilterTile& tile) {
        const std::lock_guard lock(mutex);
        EXPECT_EQ(tile.active, 0u);
        pixels += tile.box.area();
      });
  EXPECT_EQ(pixels, 70u * 40u);
}

TEST(JointFilter, TilesOfABandAreThoseOfTheWhole) {
  for (const int phase : {0, 5, -3, 1000}) {
    const JointFilterParams params;
    const RandomFrame frame({.height = 40, .rowPhase = phase}, params, 1);
    std::mutex guard;
    jointFilter(
        frame.input(), params, [](const Box&) { return 0u; },
        [&](const FilterTile& tile) {
          const std::lock_guard lock(guard);
          EXPECT_TRUE(tile.box.y0 == 0 || (tile.box.y0 + phase) % kTileHeight == 0) << phase << ": " << tile.box.y0;
        });
  }
}

// Values that are huge but finite drown their own weights, and never become NaN.
TEST(JointFilter, HugeValuesGiveNoNan) {
  const JointFilterParams params;
  const FrameShape shape{.width = 40, .height = 20, .components = 1};
  RandomFrame frame(shape, params, 1);
  auto* guide = const_cast<Guide*>(frame.input().components[0].guide[0]);
  auto* variance = const_cast<GuideVariance*>(frame.input().components[0].variance[0]);
  guide->value[0].row(9)[11] = 1e15f;
  guide->value[1].row(10)[12] = -1e15f;
  variance->value[2].row(11)[13] = 1e30f;
  variance->value[0].row(9)[14] = 0;
  forSimdTargets([&] {
    std::atomic<bool> finite = true;
    filter(frame.input(), params, 1, [&](size_t, int, int, const float* sums, const float* own) {
      for (size_t i = 0; i < 8; ++i)
        if (!std::isfinite(sums[i])) finite = false;
      if (!std::isfinite(own[0]) || !std::isfinite(own[1])) finite = false;
    });
    EXPECT_TRUE(finite);
  });
}

}  // namespace
}  // namespace fathom::deep
