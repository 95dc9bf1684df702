// The laws of split and merge, at every alpha from none to opaque.
#include "deep/volume.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <vector>

namespace fathom::deep {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

const std::vector<double> kAlphas = {
    0, double(std::numeric_limits<float>::denorm_min()), 1e-38, 3e-8, 0.001, 0.5, 0.999, 1 - 1e-7, 1};

std::vector<double> randomAlphas(size_t count, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<double> alphas(count);
  for (double& a : alphas) a = std::pow(uniform(random), 4);
  return alphas;
}

struct MergeOutcome {
  Merged merged;
  std::vector<double> weights, shares;
};

MergeOutcome mergeSlices(const std::vector<Slice>& slices) {
  MergeOutcome outcome{{}, std::vector<double>(slices.size()), std::vector<double>(slices.size())};
  outcome.merged = merge(slices, outcome.weights, outcome.shares);
  return outcome;
}

MergeOutcome mergeAll(const std::vector<double>& alphas) {
  std::vector<Slice> slices;
  for (const double alpha : alphas) slices.push_back({alpha, opticalDepth(alpha), 1});
  return mergeSlices(slices);
}

TEST(Volume, FrontPartOverBackPartIsTheWhole) {
  for (const double alpha : kAlphas)
    for (const double x : {1e-9, 0.1, 0.5, 0.75, 1 - 1e-9}) {
      const Part front = partOf(alpha, x), back = partOf(alpha, 1 - x);
      EXPECT_NEAR(front.alpha + (1 - front.alpha) * back.alpha, alpha, 4e-15 * alpha) << alpha << " at " << x;
      EXPECT_NEAR(front.weight + (1 - front.alpha) * back.weight, 1, 4e-15) << alpha << " at " << x;
    }
}

TEST(Volume, ThinVolumesSplitInProportion) {
  for (const double alpha : {1e-38, 1e-20, 3e-8}) {
    const Part part = partOf(alpha, 0.25);
    EXPECT_NEAR(part.alpha / alpha, 0.25, 1e-7) << alpha;
    EXPECT_NEAR(part.weight, 0.25, 1e-7) << alpha;
  }
}

TEST(Volume, PartsOfOpaqueVolumesAreOpaqueWithTheWholeColour) {
  EXPECT_EQ(partOf(1, 0.01).alpha, 1);
  EXPECT_EQ(partOf(1, 0.01).weight, 1);
  EXPECT_EQ(partOf(1, 0).alpha, 1);  // however thin
}

TEST(Volume, EmissionSplitsByLength) {
  EXPECT_EQ(partOf(0, 0.3).alpha, 0);
  EXPECT_EQ(partOf(0, 0.3).weight, 0.3);
}

TEST(Volume, PartsOfPartsArePartsOfTheWhole) {
  for (const double alpha : {3e-8, 0.2, 0.9, 1 - 1e-7}) {
    const Part half = partOf(alpha, 0.5), quarter = partOf(half.alpha, 0.5), direct = partOf(alpha, 0.25);
    EXPECT_NEAR(quarter.alpha, direct.alpha, 1e-14 * direct.alpha);
    EXPECT_NEAR(half.weight * quarter.weight, direct.weight, 1e-14 * direct.weight);
  }
}

TEST(Volume, MergedHalvesOfAVolumeAreTheVolume) {
  // Two samples of half the optical depth at the same place are as dense as one of the whole.
  for (const double alpha : kAlphas) {
    if (alpha == 1) continue;
    const Part half = partOf(alpha, 0.5);
    const MergeOutcome outcome = mergeAll({half.alpha, half.alpha});
    EXPECT_NEAR(outcome.merged.alpha, alpha, 1e-15 * alpha) << alpha;
    EXPECT_NEAR(half.weight * (outcome.weights[0] + outcome.weights[1]), 1, 1e-14) << alpha;
  }
}

// To what 1 - alpha of the parts keeps of alphas near 1.
TEST(Volume, MergingSlicesIsMergingTheirParts) {
  for (const double one : kAlphas)
    for (const double other : kAlphas) {
      const Slice a{one, opticalDepth(one), 0.3}, b{other, opticalDepth(other), 0.8};
      const Part partA = partOf(a), partB = partOf(b);
      const MergeOutcome atOnce = mergeSlices({a, b}), inTurn = mergeAll({partA.alpha, partB.alpha});
      EXPECT_NEAR(atOnce.merged.alpha, inTurn.merged.alpha, 1e-12 * inTurn.merged.alpha) << one << ", " << other;
      EXPECT_NEAR(atOnce.weights[0], inTurn.weights[0] * partA.weight, 1e-12) << one << ", " << other;
      EXPECT_NEAR(atOnce.weights[1], inTurn.weights[1] * partB.weight, 1e-12) << one << ", " << other;
      EXPECT_NEAR(atOnce.shares[0], inTurn.shares[0], 1e-12) << one << ", " << other;
    }
}

TEST(Volume, MergedAlphaIsThatOfCompositing) {
  for (const double a : kAlphas)
    for (const double b : kAlphas)
      EXPECT_NEAR(mergeAll({a, b}).merged.alpha, a + b - a * b, 1e-15 * (a + b)) << a << " " << b;
}

TEST(Volume, MergingCommutes) {
  for (const double a : kAlphas)
    for (const double b : kAlphas) {
      const MergeOutcome there = mergeAll({a, b}), back = mergeAll({b, a});
      EXPECT_EQ(there.merged.alpha, back.merged.alpha);
      EXPECT_EQ(there.weights[0], back.weights[1]) << a << " " << b;
      EXPECT_EQ(there.weights[1], back.weights[0]) << a << " " << b;
    }
}

TEST(Volume, MergingAssociates) {
  std::mt19937 random(1);
  for (int round = 0; round < 200; ++round) {
    const std::vector<double> a = randomAlphas(3, random);
    const MergeOutcome all = mergeAll(a), two = mergeAll({a[0], a[1]}), rest = mergeAll({two.merged.alpha, a[2]});
    EXPECT_NEAR(rest.merged.alpha, all.merged.alpha, 1e-14 * all.merged.alpha);
    EXPECT_NEAR(rest.weights[0] * two.weights[0], all.weights[0], 1e-12);
    EXPECT_NEAR(rest.weights[0] * two.weights[1], all.weights[1], 1e-12);
    EXPECT_NEAR(rest.weights[1], all.weights[2], 1e-12);
  }
}

TEST(Volume, SharesSumToOne) {
  std::mt19937 random(2);
  for (size_t count = 1; count < 20; ++count) {
    const MergeOutcome outcome = mergeAll(randomAlphas(count, random));
    double sum = 0;
    for (const double share : outcome.shares) sum += share;
    EXPECT_NEAR(sum, 1, 1e-14);
  }
}

TEST(Volume, OpaqueSamplesAverageAndHideTheOthers) {
  const MergeOutcome outcome = mergeAll({1, 0.5, 1, 0, 1});
  EXPECT_EQ(outcome.merged.alpha, 1);
  EXPECT_EQ(outcome.weights, (std::vector<double>{1.0 / 3, 0, 1.0 / 3, 0, 1.0 / 3}));
  EXPECT_EQ(outcome.merged.largest, 0u);
}

TEST(Volume, EmissionAddsUp) {
  EXPECT_EQ(mergeAll({0, 0, 0}).weights, (std::vector<double>{1, 1, 1}));
  EXPECT_EQ(mergeAll({0, 0, 0}).merged.alpha, 0);
  // Beside something that absorbs, emission is seen through a part of it.
  EXPECT_NEAR(mergeAll({0, 0.5}).weights[0], 0.5 / std::log(2.0), 1e-15);
}

TEST(Volume, TheLargestShareIsTheDensest) {
  EXPECT_EQ(mergeAll({0.1, 0.7, 0.3}).merged.largest, 1u);
  EXPECT_EQ(mergeAll({0.5, 0.5}).merged.largest, 0u);
}

TEST(Volume, RangesThatCannotBeUsedBecomePoints) {
  EXPECT_EQ(usableRange(1, 2), (Range{1, 2}));
  EXPECT_EQ(usableRange(2, 1), (Range{2, 2}));
  EXPECT_EQ(usableRange(2, kNan), (Range{2, 2}));
  EXPECT_EQ(usableRange(2, kInfinity), (Range{2, 2}));
  EXPECT_EQ(usableRange(-kInfinity, 3), (Range{-kInfinity, -kInfinity}));
  EXPECT_EQ(usableRange(kInfinity, kInfinity), (Range{kInfinity, kInfinity}));
  EXPECT_EQ(usableRange(kNan, 2), (Range{kInfinity, kInfinity}));
}

TEST(Volume, OddAlphasAndColoursAreBroughtInRange) {
  EXPECT_EQ(opacity(kNan), 0);
  EXPECT_EQ(opacity(-1), 0);
  EXPECT_EQ(opacity(kInfinity), 1);
  EXPECT_EQ(opacity(0.25f), 0.25);
  EXPECT_EQ(finiteOrZero(kNan), 0);
  EXPECT_EQ(finiteOrZero(-kInfinity), 0);
  EXPECT_EQ(finiteOrZero(2e15f), 0);
  EXPECT_EQ(finiteOrZero(-3), -3);
}

}  // namespace
}  // namespace fathom::deep
