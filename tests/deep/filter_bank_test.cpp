// The passes of the colour filter, on frames of one opaque bin per pixel. Where neither colours nor features tell bins apart,
// a pass is the mean of its window, which is what it is compared with here.
#include "deep/filter_bank.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace fathom::deep {
namespace {

constexpr int kWidth = 17, kHeight = 11;

// Random halves of unequal weights; all at one depth.
struct Frame {
  Buffer<uint64_t> offsets;
  DenoiseData data;
  Activity activity;

  explicit Frame(int width = kWidth, int height = kHeight) {
    std::mt19937 random(5);
    std::uniform_real_distribution<float> unit(0, 1);
    const size_t pixels = size_t(width) * size_t(height);
    offsets = Buffer<uint64_t>(pixels + 1);
    for (size_t i = 0; i <= pixels; ++i) offsets[i] = i;
    data.width = width;
    data.height = height;
    data.offsets = offsets.data();
    data.halves = true;
    data.weight = Buffer<float>(pixels, 1.0f);
    data.count = Buffer<float>(pixels, 8.0f);
    data.depth.value.emplace_back(pixels, 0.0f);
    data.depth.variance.emplace_back(pixels, 1e-4f);
    Buffer<float>& values = data.components.emplace_back().data;
    values = Buffer<float>(8 * pixels);
    for (size_t i = 0; i < 2 * pixels; ++i) {
      const float weight = 0.5f + 0.5f * unit(random);
      for (size_t c = 0; c < 3; ++c) values[4 * i + c] = weight * (0.4f + 0.2f * unit(random));
      values[4 * i + 3] = weight;
    }
    activity.still = Buffer<uint8_t>(pixels, 0);
    activity.light = Buffer<uint8_t>(pixels, 1);
  }

  size_t pixels() const { return data.bins(); }
  const float* half(size_t pixel, size_t h) const { return data.components[0].data.data() + 8 * pixel + 4 * h; }
  void lose(size_t pixel) { std::fill_n(data.components[0].data.data() + 8 * pixel, 8, 0.0f); }

  // The mean of a half over a window, and how many pixels of it say something.
  double mean(size_t pixel, int radius, size_t h, size_t c, int* count = nullptr) const {
    const int x = int(pixel) % data.width, y = int(pixel) / data.width;
    double sum = 0, weight = 0;
    for (int yq = std::max(0, y - radius); yq <= std::min(data.height - 1, y + radius); ++yq)
      for (int xq = std::max(0, x - radius); xq <= std::min(data.width - 1, x + radius); ++xq) {
        const float* v = half(size_t(yq) * size_t(data.width) + size_t(xq), h);
        sum += double(v[c]);
        weight += double(v[3]);
        if (count && v[3] > 0) ++*count;
      }
    return sum / weight;
  }
};

FilterPass passOf(int radius, int patchRadius = 0, bool colours = false) {
  JointFilterParams bank;
  bank.radius = radius;
  bank.patchRadius = patchRadius;
  bank.candidates = 1;
  bank.colourCandidates = colours ? 1 : 0;
  return {{bank}, {}};
}

Buffer<float> filter(const Frame& frame, ComponentGuide guide, const std::vector<FilterPass>& passes,
                     FilterCounts& counts, std::vector<HalfAnswer>* answers = nullptr) {
  std::vector<ComponentGuide> guides;
  guides.push_back(std::move(guide));
  return std::move(
      filterColours(frame.data, std::move(guides), frame.activity, passes, 0.5f, {}, counts, answers).front());
}

Buffer<float> filter(const Frame& frame, const std::vector<FilterPass>& passes,
                     std::vector<HalfAnswer>* answers = nullptr) {
  FilterCounts counts;
  return filter(frame, colourGuide(frame.data, frame.data.components[0], 8), passes, counts, answers);
}

// A bin that the third pass, which looks at nothing else, knows nothing of has the mean of the first two.
TEST(FilterBank, ResultsAreTheMeanOfThePassesThatFoundSomething) {
  Frame frame;
  const size_t lost = 5 * kWidth + 8;
  frame.lose(lost);
  const int radii[] = {2, 1, 0};
  const Buffer<float> found = filter(frame, {passOf(2), passOf(1), passOf(0)});
  for (size_t i = 0; i < frame.pixels(); ++i)
    for (size_t c = 0; c < 3; ++c) {
      double sum = 0;
      int passes = 0;
      for (const int radius : radii) {
        if (i == lost && radius == 0) continue;
        sum += (frame.mean(i, radius, 0, c) + frame.mean(i, radius, 1, c)) / 2;
        ++passes;
      }
      ASSERT_NEAR(found[3 * i + c], sum / passes, 1e-6) << i;
    }
}

TEST(FilterBank, AnswersAreTheMeanOfThePassesThatFoundSomething) {
  Frame frame;
  const size_t lost = 5 * kWidth + 8;
  frame.lose(lost);
  const int radii[] = {2, 1, 0};
  std::vector<HalfAnswer> answers;
  filter(frame, {passOf(2), passOf(1), passOf(0)}, &answers);
  ASSERT_EQ(answers.size(), 1u);
  for (size_t i = 0; i < frame.pixels(); ++i)
    for (size_t c = 0; c < 3; ++c) {
      double difference = 0, share = 0;
      int passes = 0;
      for (const int radius : radii) {
        if (i == lost && radius == 0) continue;
        double weight = 0;
        const int x = int(i) % kWidth, y = int(i) / kWidth;
        for (int yq = std::max(0, y - radius); yq <= std::min(kHeight - 1, y + radius); ++yq)
          for (int xq = std::max(0, x - radius); xq <= std::min(kWidth - 1, x + radius); ++xq)
            weight += double(frame.half(size_t(yq) * kWidth + size_t(xq), 1)[3]);
        difference += frame.mean(i, radius, 0, c) - frame.mean(i, radius, 1, c);
        share += double(frame.half(i, 1)[3]) / weight;
        ++passes;
      }
      ASSERT_NEAR(answers[0].difference[c][i], difference / passes, 1e-6) << i;
      ASSERT_NEAR(answers[0].share[1][i], share / passes, 1e-6) << i;
    }
}

// What the second pass is guided by where the first one changes nothing: the halves as they are and the variance that they
// tell, of which still pixels, whose halves are not looked at, tell nothing; these keep the guide that they had.
ComponentGuide pilotByHand(const Frame& frame, const ComponentGuide& first) {
  const int width = frame.data.width, height = frame.data.height;
  ComponentGuide pilot = colourGuide(frame.data, frame.data.components[0], 8);
  const auto forPixels = [&](const auto& body) {
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const size_t pixel = size_t(y) * size_t(width) + size_t(x);
        body(x, y, pixel, frame.activity.still[pixel] != 0);
      }
  };
  for (size_t c = 0; c < 3; ++c) {
    flat::Padded& variance = pilot.variance.value[c];
    forPixels([&](int x, int y, size_t pixel, bool still) {
      const double a = frame.mean(pixel, 0, 0, c), b = frame.mean(pixel, 0, 1, c);
      variance.row(y)[x] = still ? 0 : float((a - b) * (a - b) / 2);
      if (still) return;
      pilot.value[0].value[c].row(y)[x] = float(a);
      pilot.value[1].value[c].row(y)[x] = float(b);
    });
    prefilterVariance(variance, width, height);
    forPixels([&](int x, int y, size_t, bool still) {
      if (still) variance.row(y)[x] = first.variance.value[c].row(y)[x];
    });
    variance.extend();
    for (Guide& half : pilot.value) half.value[c].extend();
  }
  return pilot;
}

TEST(FilterBank, StillPixelsGuideTheNextPassAsTheyDidTheFirst) {
  Frame frame;
  std::mt19937 random(3);
  for (uint8_t& still : frame.activity.still) still = random() % 5 < 2;
  const FilterPass same = passOf(0), second = passOf(3, 1, true);
  const ComponentGuide first = colourGuide(frame.data, frame.data.components[0], 8);
  FilterCounts counts;
  const Buffer<float> alone = filter(frame, pilotByHand(frame, first), {second}, counts),
                      unguided = filter(frame, {second}), two = filter(frame, {same, second}),
                      three = filter(frame, {same, same, second});
  double most = 0;
  for (size_t i = 0; i < frame.pixels(); ++i)
    for (size_t c = 0; c < 3 && !frame.activity.still[i]; ++c) {
      const double own = (frame.mean(i, 0, 0, c) + frame.mean(i, 0, 1, c)) / 2, filtered = double(alone[3 * i + c]);
      ASSERT_NEAR(two[3 * i + c], (own + filtered) / 2, 1e-6) << i;
      ASSERT_NEAR(three[3 * i + c], (2 * own + filtered) / 3, 1e-6) << i;
      most = std::max(most, std::abs(filtered - double(unguided[3 * i + c])));
    }
  EXPECT_GT(most, 1e-4) << "or the guide of the second pass would not matter";
}

TEST(FilterBank, CountsWhatItLeavesOut) {
  Frame frame(kTileWidth + 8, 9);
  FilterCounts counts;
  for (size_t i = 0; i < frame.pixels(); ++i) frame.activity.still[i] = int(i) % frame.data.width < kTileWidth;
  filter(frame, colourGuide(frame.data, frame.data.components[0], 8), {passOf(1), passOf(2)}, counts);
  EXPECT_EQ(counts.tiles, 4u);
  EXPECT_EQ(counts.tilesStill, 2u);
  EXPECT_EQ(counts.tilesDark, 0u);
  EXPECT_EQ(counts.binsFiltered, 2u * 8 * 9);
  EXPECT_EQ(counts.binsSkipped, 2u * kTileWidth * 9);
}

}  // namespace
}  // namespace fathom::deep
