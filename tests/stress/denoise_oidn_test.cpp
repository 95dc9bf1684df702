// What is done before and after Open Image Denoise: whatever comes in, what comes out is finite, black stays black, and a frame
// twice as bright is denoised alike as far as the library has it so.
#include <gtest/gtest.h>

#include "flat/finite.h"
#include "flat/oidn.h"
#include "tests/oidn/installed.h"
#include "tests/reference/noisy_flat.h"
#include "tests/stress/extreme_noisy.h"
#include "tests/stress/record.h"

namespace fathom::flat {
namespace {

using stress::extremeFlat;
using stress::record;

class StressWithOidn : public reference::WithOidnInstalled {
 protected:
  static Image run(const Image& noisy, bool prefilter = true) {
    static const auto library = loadOidn(reference::kOidn);
    return oidn(library, {.prefilterGuides = prefilter})(noisy, {});
  }
};

TEST_F(StressWithOidn, AnyFrameGivesFiniteColours) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 29}, {37, 1}, {24, 17}})
    for (const float largest : {6e4f, 9e14f})
      for (const bool features : {true, false}) {
        Image noisy =
            extremeFlat({.width = width, .height = height, .seed = 3, .largest = largest, .features = features});
        stress::Draw draw(5);
        for (Plane& plane : noisy.planes)
          plane.values[draw.below(unsigned(plane.values.size()))] =
              draw.of({stress::kNan, stress::kInfinity, -stress::kInfinity, -1e10f, 1e20f});
        for (const Plane& plane : run(noisy).planes)
          for (const float v : plane.values)
            ASSERT_TRUE(isFinite(v) && v >= 0) << width << "x" << height << " to " << largest << ": " << v;
      }
}

TEST_F(StressWithOidn, BlackStaysBlack) {
  Image noisy = extremeFlat({.width = 40, .height = 30});
  for (Plane& plane : noisy.planes)
    for (size_t i = 0; i < plane.values.size(); ++i)
      if (i % 7 != 3) plane.values[i] = 0;
  const Image found = run(noisy, false);
  for (const char* c : kRgbNames)
    for (size_t i = 0; i < 1200; ++i)
      if (i % 7 != 3) {
        ASSERT_EQ(found.get(c).values[i], 0);
      }
}

// The library brings a frame to one exposure itself, in half floats.
TEST_F(StressWithOidn, FollowsTheExposure) {
  constexpr double kBound = 1e-4;
  const Image noisy = reference::makeNoisyFlat(48, 36, 3).noisy;
  const Image expected = run(noisy);
  double worst = 0;
  for (const float scale : stress::kRoundedScales) {
    const Image found = run(stress::scaled(noisy, scale));
    for (const char* c : kRgbNames)
      for (size_t i = 0; i < noisy.dataWindow.area(); ++i) {
        const double was = double(expected.get(c).values[i]);
        worst = std::max(worst, std::fabs(double(found.get(c).values[i]) / double(scale) / was - 1));
      }
  }
  record("Open Image Denoise", "exposure over 12 powers of ten", worst, kBound);
  EXPECT_LT(worst, kBound);
}

}  // namespace
}  // namespace fathom::flat
