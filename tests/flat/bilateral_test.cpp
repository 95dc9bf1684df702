#include "flat/bilateral.h"

#include <gtest/gtest.h>

#include "tests/reference/bilateral.h"
#include "tests/reference/simd_targets.h"

namespace fathom::flat {
namespace {

using reference::randomPadded;

void expectLikeTwin(int width, int height, int guides, int count, const BilateralParams& params,
                    bool variances = false) {
  const auto guide = randomPadded(guides, width, height, params.radius, 1);
  const auto in = randomPadded(count, width, height, params.radius, 2);
  std::vector<Padded> out;
  for (int i = 0; i < count; ++i) out.emplace_back(width, height, 0);
  const auto run = variances ? bilateralVariance : bilateral;
  run(width, height, params, Buffer<uint8_t>(size_t(width) * size_t(height), 1), guide, in, out);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const std::vector<double> expected = reference::bilateral(x, y, params, guide, in, variances);
      for (size_t i = 0; i < expected.size(); ++i)
        ASSERT_NEAR(out[i].row(y)[x], expected[i], 1e-5 * expected[i]) << x << ", " << y << " of " << width;
    }
}

TEST(Bilateral, EqualsItsTwinForEveryWidth) {
  forSimdTargets([] {
    for (int width = 1; width <= 70; ++width) expectLikeTwin(width, 3, 3, 2, {.radius = 2});
  });
}

TEST(Bilateral, EqualsItsTwinForWindowsAndPlanes) {
  forSimdTargets([] {
    for (int radius = 1; radius <= 5; ++radius)
      for (int planes = 1; planes <= 3; ++planes)
        expectLikeTwin(19, 12, planes, 4 - planes, {.radius = radius, .sigma = 1.5f, .sharpness = 4, .floor = 0.01f});
  });
}

TEST(Bilateral, VariancesEqualTheirTwin) {
  forSimdTargets([] {
    for (int width = 1; width <= 40; ++width) expectLikeTwin(width, 3, 3, 2, {.radius = 2}, true);
    expectLikeTwin(19, 12, 1, 4, {.radius = 5, .sigma = 1.5f, .sharpness = 4, .floor = 0.01f}, true);
  });
}

TEST(Bilateral, KeepsAConstantAndStopsAtAnEdgeOfTheGuide) {
  std::vector<Padded> guide = randomPadded(1, 40, 8, 5, 1), in = randomPadded(1, 40, 8, 5, 2), out;
  out.emplace_back(40, 8, 0);
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 40; ++x) {
      guide[0].row(y)[x] = x < 20 ? 1e-3f : 1e3f;
      in[0].row(y)[x] = x < 20 ? 2.0f : 7.0f;
    }
  guide[0].extend();
  in[0].extend();
  bilateral(40, 8, {.sharpness = 50}, Buffer<uint8_t>(40 * 8, 1), guide, in, out);
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 40; ++x) ASSERT_NEAR(out[0].row(y)[x], x < 20 ? 2 : 7, 1e-5);
}

}  // namespace
}  // namespace fathom::flat
