// Laws of the progressive mix and of our filter on flat frames.
#include <gtest/gtest.h>

#include <memory>

#include "deep/flat_nl_means.h"
#include "flat/progressive.h"
#include "tests/stress/flat_scenes.h"

namespace fathom::flat {
namespace {

using reference::boxDenoiser;
using reference::makeNoisyFlat;
using stress::forScenes;
using stress::record;
using stress::Scene;
using stress::valueAt;

std::shared_ptr<const nn::MixNet> learnedMix() {
  static const auto net = std::make_shared<const nn::MixNet>(nn::readWeights(FATHOM_DEMO "/../models/mix.safetensors"));
  return net;
}

// Our filter and a box mean, mixed with the render.
Image progressive(const Image& noisy, bool learned) {
  const Estimator estimators[] = {deep::nlMeansEstimator(deep::planFlat(noisy, {.gate = false})),
                                  byProbes(boxDenoiser())};
  ProgressiveParams params;
  if (learned) params.net = learnedMix();
  return denoiseProgressively(noisy, estimators, params);
}

// A frame with holes: converged, unknown and black pixels.
Image brokenFrame(int width, int height, unsigned seed) {
  Image noisy = makeNoisyFlat(width, height, seed).noisy;
  noisy.add("A", 1);
  noisy.add("Z", 3);
  noisy.add("samples", 16);
  for (Plane& plane : noisy.planes)
    for (size_t i = 0; i < plane.values.size(); ++i) {
      if (i % 53 == 7 && plane.name.starts_with("variance.")) plane.values[i] = 0;
      if (i % 47 == 11 && plane.name == "samples") plane.values[i] = 1;
      if (i % 43 == 5 && stress::factorOf(plane.name, 2) > 1) plane.values[i] = 0;
    }
  return noisy;
}

double farthest(const Image& a, const Image& b, double level, double scale = 1) {
  double worst = 0;
  for (const char* name : kRgbNames)
    for (size_t i = 0; i < a.dataWindow.area(); ++i) {
      const double x = valueAt(a, name, i), y = valueAt(b, name, i) / scale;
      worst = std::max(worst, std::fabs(x - y) / std::max(std::fabs(x), 0.01 * level));
    }
  return worst;
}

TEST(StressProgressive, FollowsTheExposure) {
  constexpr double kBound = 1e-4;
  for (const bool learned : {false, true}) {
    double worst = 0;
    for (int round = 0; round < stress::rounds(); ++round) {
      const Image noisy = brokenFrame(34, 27, unsigned(round + 1));
      const Image expected = progressive(noisy, learned);
      for (const std::span<const float> scales : {std::span(stress::kExactScales), std::span(stress::kRoundedScales)})
        for (const float scale : scales) {
          const Image found = progressive(stress::scaled(noisy, scale), learned);
          const double far = farthest(expected, found, 0.5, double(scale));
          EXPECT_LT(far, kBound) << scale << (learned ? ", learned" : "");
          worst = std::max(worst, far);
          for (const std::string name : kRgbNames)  // and its squares
            for (size_t i = 0; i < noisy.dataWindow.area(); ++i) {
              const double e = valueAt(expected, "error." + name, i);
              ASSERT_NEAR(valueAt(found, "error." + name, i) / double(scale) / double(scale), e, 1e-3 * e + 1e-7);
            }
        }
    }
    record(learned ? "progressive, learned mix" : "progressive, formula", "exposure over 12 powers of ten", worst,
           kBound);
  }
}

TEST(StressProgressive, AnyFrameGivesFiniteColours) {
  for (const bool learned : {false, true})
    forScenes([&](const Scene& scene) {
      const Image found = progressive(scene.noisy, learned);
      for (const Plane& plane : found.planes)
        for (const float v : plane.values) ASSERT_TRUE(std::isfinite(v)) << plane.name;
    });
}

// Level, exposure and the ratio of SURE to spread are of the whole frame, and one pixel has its share in them: of some twenty
// thousand, a few hundredths. (Absurd values took over before flat/level left them out: up to 13 times the colours.) The
// learned mix sees 40 pixels far.
TEST(StressProgressive, PoisonStaysWithinReach) {
  constexpr float kPoisons[] = {stress::kNan, stress::kInfinity, -stress::kInfinity, -1, -1e10f, 1e20f, 9e14f, 1e-42f};
  constexpr double kBound = 0.1;
  constexpr int kLength = 280, kHeight = 72, kReach = 70;
  for (const bool learned : {false, true}) {
    double worst = 0;
    const Image clean = brokenFrame(kLength, kHeight, 1);
    const Image expected = progressive(clean, learned);
    stress::Draw draw(5);
    for (int round = 0; round < 16 * stress::rounds(); ++round) {
      Image image = clean.copy();
      const size_t x = draw.below(kLength), i = x + kLength * draw.below(kHeight);
      const std::string name = image.planes[draw.below(unsigned(image.planes.size()))].name;
      const bool all = draw.below(4) == 0;
      const std::string start = all ? name.substr(0, name.find('.')) : name;
      float value = kPoisons[draw.below(unsigned(std::size(kPoisons)))];
      // The filter carries an absurd half to some hundred pixels, and more than a hundredth of so small a frame counts.
      if (start.starts_with("half") && std::fabs(value) >= 1e10f) value = stress::kNan;
      SCOPED_TRACE(testing::Message() << start << " " << value << " at " << x);
      for (Plane& plane : image.planes)
        if (plane.name.starts_with(start)) plane.values[i] = value;
      const Image found = progressive(image, learned);
      for (const Plane& plane : found.planes)
        for (const float v : plane.values) ASSERT_TRUE(std::isfinite(v)) << plane.name;
      for (const char* c : kRgbNames)
        for (size_t p = 0; p < image.dataWindow.area(); ++p) {
          if (std::abs(int(p % kLength) - int(x)) <= kReach) continue;
          const double was = valueAt(expected, c, p),
                       far = std::fabs(valueAt(found, c, p) - was) / std::max(was, 0.005);
          ASSERT_LT(far, kBound) << c << " at " << p % kLength;
          worst = std::max(worst, far);
        }
    }
    record(learned ? "progressive, learned mix" : "progressive, formula",
           "poison: what moves out of reach, by sums over the frame", worst, kBound);
  }
}

// Our filter by itself on flat pixels has no sums over the frame but its plan's.
TEST(StressProgressive, TheFlatFilterKeepsPoisonAndWindows) {
  constexpr int kLength = 150;
  const Image clean = brokenFrame(kLength, 6, 1);
  const deep::DenoisePlan plan = deep::planFlat(clean, {});
  const Image expected = flatNlMeans(plan)(clean, {});
  const int halo = denoiseHalo(plan);
  for (int round = 0; round < 30; ++round) {
    Image image = clean.copy();
    stress::Draw draw(unsigned(round) + 77);
    const size_t x = draw.below(kLength), i = x + kLength * draw.below(6);
    for (Plane& plane : image.planes)
      if (draw.below(3) == 0) plane.values[i] = draw.of({stress::kNan, stress::kInfinity, -1e10f, 9e14f, -1e20f});
    const Image found = flatNlMeans(plan)(image, {});
    for (const char* c : kRgbNames)
      for (size_t p = 0; p < image.dataWindow.area(); ++p) {
        const float v = found.get(c).values[p];
        ASSERT_TRUE(std::isfinite(v));
        if (std::abs(int(p % kLength) - int(x)) > halo) {
          ASSERT_TRUE(stress::sameBits(v, expected.get(c).values[p])) << p % kLength << " from " << x;
        }
      }
  }
  for (const auto& [dx, dy] : {std::pair{1, 2}, {-1003, 77}}) {
    Image shifted = clean.copy();
    shifted.dataWindow = {clean.dataWindow.x0 + dx, clean.dataWindow.y0 + dy, clean.dataWindow.x1 + dx,
                          clean.dataWindow.y1 + dy};
    EXPECT_EQ(farthest(expected, flatNlMeans(plan)(shifted, {}), 0.5), 0);
  }
}

}  // namespace
}  // namespace fathom::flat
