// Deep pixels that are means of others: flattened, and cut at any depth, they are the mean of the flattened pixels.
#include "deep/ops/resample.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "base/error.h"
#include "deep/clip.h"
#include "deep/flatten.h"
#include "deep/ops/crop.h"
#include "deep/tidy.h"
#include "tests/reference/deep_samples.h"
#include "tests/reference/random_ops.h"
#include "tests/reference/resample.h"

namespace fathom::deep {
namespace {

using reference::Interval;
using reference::randomSamples;
using reference::Sample;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

std::vector<Interval> intervals(const AxisMap& map, int begin, int end) {
  std::vector<Interval> result;
  for (int i = begin; i < end; ++i)
    result.push_back({map.from + (i - map.to) * map.num / map.den, map.from + (i + 1 - map.to) * map.num / map.den});
  return result;
}

double largest(const flat::Image& image, const std::string& plane) {
  double result = 1;
  for (const float value : image.get(plane).values) result = std::max(result, std::abs(double(value)));
  return result;
}

// Compares flatten(result) with the resampled flatten(image), relative to the largest value.
void expectFlattensTo(const DeepImage& result, const DeepImage& image, const Resampling& how, const std::string& what,
                      double bound = 1e-6) {
  const flat::Image flat = flatten(image), made = flatten(result);
  const Box& window = result.dataWindow;
  for (const char* name : {"R", "G", "B", "A"}) {
    const std::vector<double> expected =
        reference::resampled(flat, name, window, intervals(how.columns, window.x0, window.x1),
                             intervals(how.rows, window.y0, window.y1), how.filter == Filter::Bilinear);
    for (size_t i = 0; i < expected.size(); ++i)
      ASSERT_NEAR(made.get(name).values[i], expected[i], bound * largest(flat, name))
          << name << ", pixel " << i << ", " << what;
  }
}

std::vector<Resampling> manners() {
  return {{.columns = {.to = 0.5}, .rows = {.to = 0.25}},
          {.columns = {.to = -3.75}, .rows = {.to = 2}},
          {.columns = {.num = 3}, .rows = {.num = 3}},
          {.columns = {.from = -1, .to = 2, .num = 9, .den = 4}, .rows = {.from = 2, .num = 7, .den = 2}},
          {.columns = {.num = 9, .den = 20}, .rows = {.num = 7, .den = 16}},
          {.columns = {.den = 2}, .rows = {.den = 3}},
          {.columns = {.num = 9, .den = 20}, .rows = {.num = 7, .den = 16}, .filter = Filter::Bilinear},
          {.columns = {.num = 5, .den = 2}, .rows = {.num = 7, .den = 3}, .filter = Filter::Bilinear}};
}

TEST(Resample, FlattenedIsTheMeanOfTheFlattened) {
  for (unsigned seed = 1; seed <= 12; ++seed)
    for (const bool odd : {false, true}) {
      const DeepImage image = randomSamples(
          {.seed = seed, .volumes = seed % 3 != 0, .most = seed % 4 ? 6u : 30u, .odd = odd, .sorted = seed % 2 == 0});
      for (size_t m = 0; m < manners().size(); ++m)
        for (const double tolerance : {0.0, 0.01, 0.3}) {
          Resampling how = manners()[m];
          how.tolerance = tolerance;
          expectFlattensTo(resample(image.copy(), how), image, how,
                           fmt::format("seed {}, odd {}, manner {}, tolerance {}", seed, odd, m, tolerance));
        }
    }
}

TEST(Resample, IsTheMeanInFrontOfEveryDepth) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomSamples({.seed = seed});
    for (size_t m = 0; m < manners().size(); ++m) {
      Resampling how = manners()[m];
      how.tolerance = 0;
      const DeepImage result = resample(image.copy(), how);
      for (const float z : {1.5f, 2.0f, 2.9f, 4.0f})
        expectFlattensTo(clip(result, -kInfinity, z), clip(image, -kInfinity, z), how,
                         fmt::format("seed {}, manner {}, z {}", seed, m, z));
    }
  }
}

// Volumes that end at the same depths in all pixels.
DeepImage slices(unsigned seed) {
  DeepImage image = randomSamples({.seed = seed, .volumes = true});
  for (size_t p = 0; p < image.pixels(); ++p)
    for (size_t s = image.offsets[p]; s < image.offsets[p + 1]; ++s) {
      image.get("Z")[s] = float(1 + s - image.offsets[p]);
      image.get("ZBack")[s] = image.get("Z")[s] + (s % 3 == 0 ? 0.0f : 1.0f);
    }
  return image;
}

TEST(Resample, IsTheMeanInFrontOfEveryEndOfAVolume) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = slices(seed);
    for (size_t m = 0; m < manners().size(); ++m) {
      Resampling how = manners()[m];
      how.tolerance = 0;
      const DeepImage result = resample(image.copy(), how);
      for (const float z : {2.0f, 3.0f, 4.0f, 5.0f})
        expectFlattensTo(clip(result, -kInfinity, z), clip(image, -kInfinity, z), how,
                         fmt::format("seed {}, manner {}, z {}", seed, m, z));
    }
  }
}

TEST(Resample, MovesNothingInDepthByMoreThanTheTolerance) {
  constexpr double kTolerance = 0.05;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = slices(seed);
    Resampling how = manners()[3];
    how.tolerance = kTolerance;
    const flat::Image flat = flatten(resample(image.copy(), how));
    const DeepImage result = resample(image.copy(), how);
    // What is in front of a depth lies between what was in front of a little less and of a little more.
    for (const float z : {2.5f, 3.5f}) {
      const flat::Image made = flatten(clip(result, -kInfinity, z));
      how.tolerance = 0;
      const DeepImage exact = resample(image.copy(), how);
      const flat::Image less = flatten(clip(exact, -kInfinity, z * float(1 - kTolerance)));
      const flat::Image more = flatten(clip(exact, -kInfinity, z * float(1 + kTolerance)));
      for (size_t i = 0; i < made.get("A").values.size(); ++i) {
        EXPECT_GE(made.get("A").values[i], less.get("A").values[i] - 1e-6f) << "seed " << seed << ", pixel " << i;
        EXPECT_LE(made.get("A").values[i], more.get("A").values[i] + 1e-6f) << "seed " << seed << ", pixel " << i;
      }
    }
  }
}

TEST(Resample, MakesTidyPixels) {
  for (unsigned seed = 1; seed <= 10; ++seed)
    for (const Resampling& how : manners()) {
      const DeepImage image = randomSamples({.seed = seed, .volumes = true, .most = 12, .odd = true, .sorted = false});
      EXPECT_TRUE(!how.mixes() || isTidy(resample(image.copy(), how))) << "seed " << seed;
    }
}

TEST(Resample, CopiesPixelsThatAreEnlargedByWholeFactors) {
  DeepImage image = randomSamples({.seed = 3, .volumes = true, .odd = true, .sorted = false});
  image.add("samples", PixelType::Float).values.fill(3);
  const Resampling how{.columns = {.from = -1, .to = -1, .den = 2}, .rows = {.from = 2, .to = 4, .den = 3}};
  const DeepImage result = resample(image.copy(), how);
  EXPECT_EQ(result.dataWindow, (Box{-1, 4, 17, 25}));
  for (int y = 2; y < 9; ++y)
    for (int x = -1; x < 8; ++x)
      for (int dy = 0; dy < 3; ++dy)
        for (int dx = 0; dx < 2; ++dx) {
          DeepImage there =
              toWindow(result, {-1 + 2 * (x + 1) + dx, 4 + 3 * (y - 2) + dy, 2 * (x + 1) + dx, 5 + 3 * (y - 2) + dy});
          there.dataWindow = {x, y, x + 1, y + 1};
          ASSERT_EQ(reference::difference(there, toWindow(image, {x, y, x + 1, y + 1})), "");
        }
}

TEST(Resample, ShrinkingAFlatSurfaceLeavesOneSample) {
  DeepImage image = randomSamples({.window = {0, 0, 16, 16}, .seed = 5, .most = 1});
  for (size_t s = 0; s < image.samples(); ++s) image.get("Z")[s] = 10 + 0.05f * float(s % 2);
  const DeepImage result = resample(std::move(image), {.columns = {.num = 4}, .rows = {.num = 4}});
  for (size_t p = 0; p < result.pixels(); ++p) EXPECT_LE(result.count(p), 1u);
}

TEST(Resample, KeepsEdgesBetweenDepthsOpaque) {
  // Half of the pixel is opaque at 1, half at 5: together opaque, and half of it in front of 2.
  DeepImage image = randomSamples({.window = {0, 0, 2, 1}, .seed = 2, .most = 1});
  image.offsets[1] = 1, image.offsets[2] = 2;
  std::vector<std::string> names;
  for (const Channel& channel : image.channels) names.push_back(channel.name);
  for (const std::string& name : names) {
    Channel& channel = image.add(name, name == "id" ? PixelType::Uint : PixelType::Float);
    channel.values.fill(1);
    channel.ids.fill(8);
  }
  image.get("Z")[1] = 5;
  image.get("R")[1] = 3;
  const DeepImage result = resample(std::move(image), {.columns = {.num = 2}});
  ASSERT_EQ(result.samples(), 2u);
  EXPECT_EQ(result.get("A")[0], 0.5f);
  EXPECT_EQ(result.get("A")[1], 1.0f);
  EXPECT_EQ(result.get("R")[0], 0.5f);
  EXPECT_EQ(result.get("R")[1], 3.0f);
}

// The mean of pixels of these samples.
std::vector<Sample> meanOf(const reference::Pixels& pixels, double tolerance) {
  const int width = int(pixels.size());
  const AxisMap columns{.from = 3, .num = double(width)};  // where the image begins
  return reference::samplesOf(
      resample(reference::makeDeep(pixels, width), {.columns = columns, .tolerance = tolerance}), 0);
}

TEST(Resample, UnitesToAPointWherePointsAreMostOfWhatIsSeen) {
  const auto points =
      meanOf({{{.z = 10, .zBack = 10, .alpha = 0.25f}}, {{.z = 10.05f, .zBack = 10.05f, .alpha = 0.75f}}}, 0.01);
  ASSERT_EQ(points.size(), 1u);
  EXPECT_NEAR(points[0].z, 10.0375f, 1e-5f);
  EXPECT_EQ(points[0].zBack, points[0].z);
  const auto behind =
      meanOf({{{.z = -10, .zBack = -10, .alpha = 0.25f}}, {{.z = -10.05f, .zBack = -10.05f, .alpha = 0.75f}}}, 0.01);
  ASSERT_EQ(behind.size(), 1u) << "depths behind the camera are as near to one another";
  EXPECT_NEAR(behind[0].z, -10.0375f, 1e-5f);
  for (const float alpha : {0.6f, 0.3f}) {
    const auto both =
        meanOf({{{.z = 10, .zBack = 10, .alpha = alpha}}, {{.z = 10, .zBack = 10.05f, .alpha = 0.45f}}}, 0.01);
    ASSERT_EQ(both.size(), 1u);
    EXPECT_EQ(both[0].z, 10);
    EXPECT_EQ(both[0].zBack, alpha > 0.45f ? 10 : 10.05f) << alpha;
  }
  const auto emission =
      meanOf({{{.z = 10, .zBack = 10, .colour = 1}}, {{.z = 10.05f, .zBack = 10.05f, .colour = 1}}}, 0.01);
  ASSERT_EQ(emission.size(), 1u);
  EXPECT_EQ(emission[0].zBack, emission[0].z);
  EXPECT_EQ(emission[0].colour, 1);
}

TEST(Resample, LeavesNoSampleOfNothing) {
  const auto volume = meanOf({{{.z = 1, .zBack = 2, .alpha = 0.5f, .colour = 0.5f}}, {}}, 0);
  ASSERT_EQ(volume.size(), 1u);
  EXPECT_EQ(volume[0].z, 1);
  EXPECT_EQ(volume[0].zBack, 2);
  const auto opaque = meanOf({{{.z = 1, .zBack = 1, .alpha = 1}, {.z = 5, .zBack = 5, .alpha = 0.5f, .colour = 1}},
                              {{.z = 2, .zBack = 2, .alpha = 1}, {.z = 6, .zBack = 6, .colour = 1}}},
                             0);
  EXPECT_EQ(opaque.size(), 2u) << "what is hidden goes";
}

// Thirds do not add up to 1 in double; what is missing must not shine through.
TEST(Resample, OpaquePixelsStayOpaqueHoweverLittleReachesTheirLastSample) {
  const std::vector<Sample> pixel = {{.z = 1, .zBack = 1, .alpha = 0x1.fffffep-1f},
                                     {.z = 2, .zBack = 2, .alpha = 0x1.fffffep-1f},
                                     {.z = 3, .zBack = 3, .alpha = 1}};
  const auto mean = meanOf({pixel, pixel, pixel}, 0);
  ASSERT_EQ(mean.size(), 3u);
  EXPECT_EQ(mean[2].alpha, 1);
}

// Places that are off by rounding alone neither add a column nor make an edge.
TEST(Resample, RoundingMakesNoEdges) {
  const AxisMap odd{.num = 0.1, .den = 0.3};  // three times as large, or a little less
  EXPECT_EQ(resultOf(odd, {1, 2}).begin, 3);
  EXPECT_EQ(resultOf(odd, {1, 2}).end, 6);
  const AxisMap far{.from = 3 - 299970.0, .num = 0.9, .den = 0.3};
  const Cover cover(far, Filter::Box, {3, 6}, {99990, 99991});
  double sum = 0;
  for (const double weight : cover.weights(99990)) sum += weight;
  EXPECT_NEAR(sum, 1, 1e-15);
}

TEST(Resample, IdsAreThoseOfTheSourceAndTheMostSeenOnesStay) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const DeepImage image = randomSamples({.seed = seed, .volumes = true, .odd = true});
    const Buffer<uint32_t>& ids = image.find("id")->ids;
    const std::set<uint32_t> known(ids.begin(), ids.end());
    for (const Resampling& how : manners()) {
      const DeepImage result = resample(image.copy(), how);
      for (const uint32_t id : result.find("id")->ids) ASSERT_TRUE(known.contains(id)) << "seed " << seed;
    }
  }
  DeepImage image = randomSamples({.window = {0, 0, 2, 1}, .seed = 1, .most = 1});
  if (image.samples() == 2) {
    image.get("Z")[0] = image.get("Z")[1] = 3;
    image.get("A")[0] = 0.25f;
    image.get("A")[1] = 0.75f;
    const uint32_t id = image.find("id")->ids[1];
    EXPECT_EQ(resample(std::move(image), {.columns = {.num = 2}}).find("id")->ids[0], id);
  }
}

TEST(Resample, DropsStatisticsBecauseOfTheMannerAlone) {
  DeepImage image = randomSamples({.seed = 1});
  image.add("half0.R", PixelType::Float).values.fill(1);
  image.add("variance.R", PixelType::Float).values.fill(1);
  for (const DeepImage& part : {rows(image, 3, 5), rows(image, 3, 3)}) {
    const DeepImage mixed = resample(part.copy(), manners()[0]);
    EXPECT_FALSE(mixed.find("half0.R") || mixed.find("variance.R"));
    EXPECT_TRUE(resample(part.copy(), manners()[5]).find("half0.R"));
  }
}

TEST(Resample, BandsGiveTheSameBits) {
  const DeepImage image =
      randomSamples({.window = {-3, -2, 14, 21}, .seed = 9, .volumes = true, .odd = true, .sorted = false});
  for (const Resampling& how : manners()) {
    const DeepImage whole = resample(image.copy(), how);
    const Box& window = whole.dataWindow;
    for (int y0 = window.y0, y1 = 0; y0 < window.y1; y0 = y1) {
      y1 = std::min(window.y1, y0 + 3);
      const Extent needed = neededBy(how.rows, how.filter, {y0, y1});
      const int first = std::clamp(needed.begin, image.dataWindow.y0, image.dataWindow.y1);
      const DeepImage band = resample(rows(image, first, std::clamp(needed.end, first, image.dataWindow.y1)), how);
      ASSERT_EQ(reference::difference(toWindow(band, {window.x0, y0, window.x1, y1}), rows(whole, y0, y1)), "");
    }
  }
}

TEST(Resample, OfNothingIsNothing) {
  for (const Box window : {Box{4, 4, 4, 4}, Box{0, 3, 8, 3}, Box{0, 0, 5, 4}}) {
    DeepImage image{window, {0, 0, 8, 8}, Buffer<uint64_t>(window.area() + 1, 0), {}, {}};
    for (const char* name : {"A", "Z"}) image.add(name, PixelType::Half);
    for (const Resampling& how : manners()) {
      const DeepImage result = resample(image.copy(), how);
      EXPECT_EQ(result.samples(), 0u);
      EXPECT_EQ(result.dataWindow.empty(), window.empty());
      EXPECT_EQ(result.channels.size(), 2u);
    }
  }
}

}  // namespace
}  // namespace fathom::deep
