#include "deep/clip_view.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cstring>
#include <random>

#include "base/error.h"
#include "deep/clip.h"
#include "deep/flatten.h"
#include "deep/tidy.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_deep.h"

namespace fathom::deep {
namespace {

using reference::makeDeep;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
const std::vector<std::string> kChannels = {"R", "N.X", "coc", "Z"};

// Any values at all, volumes that overlap, NaN and infinities among them; or, tidied, a usual image.
DeepImage anyImage(unsigned seed, bool tidied) {
  DeepImage image = reference::randomDeep({-2, 1, 9, 15}, {0, 0, 8, 8},
                                          {{"R", PixelType::Float},
                                           {"N.X", PixelType::Half},
                                           {"coc", PixelType::Float},
                                           {"A", PixelType::Float},
                                           {"Z", PixelType::Float},
                                           {"ZBack", PixelType::Float}},
                                          seed, 6);
  std::mt19937 random(seed);
  const auto z = image.get("Z"), zBack = image.get("ZBack"), alpha = image.get("A");
  for (size_t i = 0; i < image.samples(); ++i) {
    z[i] = std::fmod(z[i], 8.0f);
    if (random() % 2) zBack[i] = z[i] + float(random() % 16) / 8;
    if (random() % 8) alpha[i] = float(random() % 65) / 64;
  }
  return tidied ? tidy(std::move(image)).image : std::move(image);
}

// As the header says it, from what stands elsewhere.
flat::Image slowView(const DeepImage& image, const Box& box, int step, const DepthRange& range) {
  const flat::Image whole = flatten(clip(image, range.near, range.far));
  const Box window{0, 0, (box.width() + step - 1) / step, (box.height() + step - 1) / step};
  flat::Image result{window, window, {}, {}};
  for (const char* name : {"R", "N.X", "coc", "Z", "A"}) {
    Buffer<float>& to = result.add(name).values;
    for (int y = 0; y < window.y1; ++y)
      for (int x = 0; x < window.x1; ++x)
        if (const int fromX = box.x0 + x * step, fromY = box.y0 + y * step; whole.dataWindow.contains(fromX, fromY))
          to[window.index(x, y)] = whole.get(name).values[whole.dataWindow.index(fromX, fromY)];
  }
  return result;
}

void expectNear(const flat::Image& found, const flat::Image& expected, const std::string& what) {
  ASSERT_EQ(found.dataWindow, expected.dataWindow) << what;
  ASSERT_EQ(found.planes.size(), expected.planes.size()) << what;
  for (const flat::Plane& plane : expected.planes)
    for (size_t i = 0; i < expected.dataWindow.area(); ++i) {
      const float a = found.get(plane.name).values[i], b = plane.values[i];
      if (a == b) continue;  // infinities, too
      ASSERT_NEAR(a, b, 2e-6f * (16 + std::abs(b))) << what << ": " << plane.name << " of pixel " << i;
    }
}

const DepthRange kHard[] = {
    {},     {0.5f, kInfinity},      {-kInfinity, 1.125f},     {-0.5f, 2.25f}, {1, 1.0625f}, {2, 1},
    {1, 1}, {kInfinity, kInfinity}, {-kInfinity, -kInfinity}, {100, 200}};

TEST(ClipView, IsFlattenOfClip) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const DeepImage image = anyImage(seed, seed % 2 == 0);
    for (const DepthRange& range : kHard)
      expectNear(clipView(image, image.dataWindow, 1, range, kChannels), slowView(image, image.dataWindow, 1, range),
                 fmt::format("seed {}, {} to {}", seed, range.near, range.far));
  }
}

// The quick way for colours and the one for any channels say the same.
TEST(ClipView, OfFewChannelsIsThatOfMany) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    DeepImage image = anyImage(seed, seed % 2 == 0);
    for (const char* name : {"B", "diffuse.B"})  // four colours are more than are composited at once
      std::ranges::copy(std::as_const(image).get("R"), image.add(name, PixelType::Float).values.begin());
    for (const DepthRange& range : {DepthRange{-0.5f, 2}, DepthRange{-0.5f, 2, 0.25f}, DepthRange{-0.5f, 2, 0, true}}) {
      const flat::Image many = clipView(image, image.dataWindow, 1, range, kChannels);
      const flat::Image few = clipView(image, image.dataWindow, 1, range, {"R", "N.X"});
      for (const flat::Plane& plane : few.planes)
        EXPECT_TRUE(std::ranges::equal(plane.values, many.get(plane.name).values));
      const flat::Image four = clipView(image, image.dataWindow, 1, range, {"R", "N.X", "B", "diffuse.B"});
      for (const char* name : {"R", "B", "diffuse.B"})
        EXPECT_TRUE(std::ranges::equal(four.get(name).values, many.get("R").values)) << name;
    }
  }
}

TEST(ClipView, SumsEndAtTheLargest) {
  const DeepImage image = reference::makeDeep({{{1, 1, 0, 9e14f}, {2, 2, 0, 9e14f}}}, 1);
  for (const auto& names : {std::vector<std::string>{"R"}, {"R", "R", "B", "A"}})
    EXPECT_EQ(clipView(image, image.dataWindow, 1, {}, names).get("R").values[0], flatten(image).get("R").values[0]);
}

TEST(ClipView, OfAnyBoxAndStepTakesPixelsOfTheWhole) {
  const DeepImage image = anyImage(3, true);
  for (const Box& box : {Box{-2, 1, 9, 15}, Box{-7, -5, 20, 30}, Box{1, 2, 6, 9}, Box{40, 40, 50, 50}, Box{3, 3, 3, 3}})
    for (const int step : {1, 2, 3, 7})
      for (const auto& names : {kChannels, std::vector<std::string>{"R"}}) {
        flat::Image expected = slowView(image, box, step, {0, 2});
        std::erase_if(expected.planes, [&](const flat::Plane& plane) {
          return plane.name != "A" && std::ranges::find(names, plane.name) == names.end();
        });
        expectNear(clipView(image, box, step, {0, 2}, names), expected, fmt::format("step {}", step));
      }
}

TEST(ClipView, BeforeOverRangeOverBehindIsTheWhole) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = reference::randomStack(seed);
    const auto view = [&](const DepthRange& range) { return clipView(image, image.dataWindow, 1, range, {"R"}); };
    const flat::Image whole = view({}), before = view({-kInfinity, 0.75f}), range = view({0.75f, 2.5f}),
                      behind = view({2.5f, kInfinity}), removed = view({0.75f, 2.5f, 0, true});
    for (size_t i = 0; i < image.pixels(); ++i) {
      const auto r = [&](const flat::Image& of) { return of.get("R").values[i]; };
      const auto a = [&](const flat::Image& of) { return of.get("A").values[i]; };
      EXPECT_NEAR(r(removed), r(before) + (1 - a(before)) * r(behind), 2e-6f);
      EXPECT_NEAR(a(removed), a(before) + (1 - a(before)) * a(behind), 2e-6f);
      EXPECT_NEAR(r(whole), r(before) + (1 - a(before)) * (r(range) + (1 - a(range)) * r(behind)), 2e-6f);
      EXPECT_NEAR(1 - a(whole), (1 - a(range)) * (1 - a(removed)), 2e-6f);
    }
  }
}

TEST(ClipView, SoftFadesTowardsTheHardPlane) {
  const DeepImage image = reference::randomStack(7);
  const auto view = [&](float soft) { return clipView(image, image.dataWindow, 1, {0.8f, 2.1f, soft}, {"R"}); };
  expectNear(view(1e-7f), view(0), "nearly hard");
  float before = 0;
  for (const float soft : {0.65f, 0.3f, 0.1f, 0.0f}) {
    float sum = 0;
    const flat::Image faded = view(soft);
    for (const float a : faded.get("A").values) sum += a;
    EXPECT_GT(sum, before) << soft;
    before = sum;
  }
}

TEST(ClipView, StatisticsAndBacksHaveAMeaningOfTheirOwn) {
  DeepImage image = makeDeep({{{1, 2, 0.5f, 0.4f}, {3, 5, 0.5f, 0.2f}, {6, 6, 1, 0.8f}}, {}}, 2);
  const auto add = [&](const char* name, const std::array<float, 3>& values) {
    std::ranges::copy(values, image.add(name, PixelType::Float).values.begin());
  };
  add("variance.R", {0.5f, 1, 2});
  add("samples", {3, 4, 5});
  const std::vector<std::string> names = {"variance.R", "samples", "ZBack"};
  const flat::Image all = clipView(image, image.dataWindow, 1, {}, names);
  EXPECT_FLOAT_EQ(all.get("variance.R").values[0], 0.5f + 0.25f * 1 + 0.0625f * 2);
  EXPECT_FLOAT_EQ(all.get("samples").values[0], 12);
  EXPECT_FLOAT_EQ(all.get("ZBack").values[0], 0.5f * 2 + 0.25f * 5 + 0.25f * 6);
  for (const std::string& name : names) EXPECT_EQ(all.get(name).values[1], 0) << name;
  const flat::Image front = clipView(image, image.dataWindow, 1, {0, 3.5f}, names);
  EXPECT_FLOAT_EQ(front.get("samples").values[0], 7);
  // Both ends of the second sample are left.
  const flat::Image ends = clipView(image, image.dataWindow, 1, {3.5f, 4.5f, 0, true}, names);
  EXPECT_FLOAT_EQ(ends.get("samples").values[0], 12);
}

TEST(ClipView, HasTheSameBitsForAnyNumberOfThreads) {
  const DeepImage image = anyImage(5, false);
  const auto view = [&](size_t threads) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    return clipView(image, image.dataWindow, 1, {0, 2, 0.25f}, kChannels);
  };
  const flat::Image one = view(1), many = view(4);
  for (const flat::Plane& plane : one.planes)
    EXPECT_EQ(std::memcmp(plane.values.data(), many.get(plane.name).values.data(), 4 * plane.values.size()), 0);
}

TEST(ClipView, NamesTheChannelThatIsMissing) {
  DeepImage image = reference::randomStack(1);
  EXPECT_THROW(clipView(image, image.dataWindow, 1, {}, {"nothing"}), Error);
  EXPECT_THROW(clipView(image, image.dataWindow, 1, {}, {"id"}), Error);
  EXPECT_EQ(clipView(image, image.dataWindow, 1, {}, {"R", "R", "A"}).planes.size(), 2u);
  image.erase("A");
  EXPECT_THROW(clipView(image, image.dataWindow, 1, {}, {"R"}), Error);
}

}  // namespace
}  // namespace fathom::deep
