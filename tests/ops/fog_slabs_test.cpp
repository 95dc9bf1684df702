// The slabs of a fog along single rays, against its integral in closed form, wherever cameras and fogs may be.
#include "deep/ops/fog_slabs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace fathom::deep {
namespace {

// An image without samples, seen from (0, 3, 0) along the world's -z by a camera that is tilted.
DeepImage seenFrom(double tilt) {
  DeepImage image;
  image.dataWindow = image.displayWindow = {0, 0, 9, 7};
  const float c = float(std::cos(tilt)), s = float(std::sin(tilt));
  image.attributes.set("worldToCamera",
                       std::array<float, 16>{1, 0, 0, 0, 0, c, -s, 0, 0, -s, -c, 0, 0, -3 * c, 3 * s, 1});
  image.attributes.set("fieldOfView", 60.0f);
  return image;
}

// The optical depth of a ray from `near` to z. Above its height the density falls by a factor e every falloff; the integral
// over a stretch of heights is that of the part below and that of the part above.
double depthAlong(const ViewRay& ray, const FogParams& params, double z) {
  using Real = long double;  // heights are nearly the same along a ray that is nearly level
  const Real full = Real(params.density) * Real(ray.length), falloff = params.height->falloff;
  const auto above = [&](Real at) { return Real(ray.start) + at * Real(ray.slope) - Real(params.height->height); };
  const Real a = above(params.near), b = above(z), low = std::min(a, b), high = std::max(a, b), none = 0;
  if (ray.slope == 0) return double(full * (Real(z) - Real(params.near)) * std::exp(-std::max(none, a) / falloff));
  const Real below = std::max(none, std::min(high, none) - low), from = std::max(low, none);
  const Real thin = high > from ? falloff * std::exp(-from / falloff) * -std::expm1((from - high) / falloff) : 0;
  return double(full * (below + thin) / std::abs(Real(ray.slope)));
}

class Ray {
 public:
  Ray(const FogParams& params, double tilt, int x, int y)
      : params_(params),
        image_(seenFrom(tilt)),
        ray_(ViewRays(image_.attributes, image_.displayWindow, {}, Axis::Y).at(x, y)),
        slabs_(image_, params_) {
    slabs_.set(x, y);
  }

  const FogSlabs& slabs() const { return slabs_; }
  double depthTo(double z) const { return depthAlong(ray_, params_, z); }

 private:
  const FogParams params_;
  const DeepImage image_;
  const ViewRay ray_;
  FogSlabs slabs_;
};

struct Fogs {
  std::mt19937 random{7};

  double even(double from, double to) { return std::uniform_real_distribution(from, to)(random); }
  double power(double from, double to) { return std::pow(10, even(from, to)); }
  FogParams next() {
    FogParams params{.near = even(0, 5), .density = power(-3, 4)};
    params.far = params.near + power(-6, 2.5);
    const int slabs[] = {1, 5, 16, 200};
    params.height = FogHeight{.height = even(-5, 8), .falloff = power(-3, 3), .slabs = slabs[random() % 4]};
    return params;
  }
};

// False where an emulator, as valgrind's, computes in double instead.
bool longDoubleIsLonger() {
  const volatile long double one = 1, next = one + std::numeric_limits<long double>::epsilon();
  return next > one;
}

TEST(FogSlabs, BordersAreOnTheIntegralAndInOrder) {
  if (!longDoubleIsLonger()) GTEST_SKIP() << "skipped: the integral needs long double";
  Fogs fogs;
  for (int i = 0; i < 10000; ++i) {
    const FogParams params = fogs.next();
    const Ray ray(params, fogs.even(-1.5, 1.5), i % 9, i % 7);
    const auto borders = ray.slabs().borders();
    const auto depths = ray.slabs().depths();
    const double all = ray.depthTo(params.far);
    ASSERT_EQ(borders.size(), depths.size());
    if (all < 1e-290) continue;  // no number is exact there
    ASSERT_GE(borders.size(), 2u);
    ASSERT_EQ(borders.front(), float(params.near));
    ASSERT_EQ(borders.back(), float(params.far));
    ASSERT_EQ(depths.front(), 0);
    ASSERT_NEAR(depths.back() / all, 1, 1e-7) << i;
    for (size_t k = 1; k < borders.size(); ++k) {
      ASSERT_LT(borders[k - 1], borders[k]) << i;
      ASSERT_LE(depths[k - 1], depths[k]) << i;
      if (k + 1 < borders.size()) {
        ASSERT_NEAR(depths[k] / all, ray.depthTo(double(borders[k])) / all, 1e-7) << i << ", border " << k;
      }
    }
  }
}

// Of a fog whose top is as sharp as FLOAT depths are, borders may be on the other side of it.
TEST(FogSlabs, BordersAreInOrderAcrossTopsAsSharpAsDepths) {
  Fogs fogs;
  for (int i = 0; i < 10000; ++i) {
    FogParams params = fogs.next();
    const double tilt = fogs.even(-1.5, 1.5), level = fogs.power(-7, -5);
    const DeepImage image = seenFrom(tilt);
    const ViewRay ray = ViewRays(image.attributes, image.displayWindow, {}, Axis::Y).at(i % 9, i % 7);
    params.far = params.near + 1;
    params.height->height = ray.start + (params.near + level) * ray.slope;
    params.height->falloff = level * std::abs(ray.slope) * fogs.power(-2.5, 0.5);
    const Ray sharp(params, tilt, i % 9, i % 7);
    const auto borders = sharp.slabs().borders();
    const auto depths = sharp.slabs().depths();
    ASSERT_EQ(borders.size(), depths.size());
    for (size_t k = 1; k < borders.size(); ++k) {
      ASSERT_LT(borders[k - 1], borders[k]) << i;
      ASSERT_LE(depths[k - 1], depths[k]) << i;
    }
  }
}

// The same optical depth each, as far as FLOAT depths can tell; thick fog has more of them.
TEST(FogSlabs, HoldTheSameEach) {
  // Thinning out from where it begins, and behind; growing denser all the way, and up to where it is full.
  for (const auto& [tilt, height] : {std::pair{-0.3, 0.0}, {-0.6, 2.8}, {0.3, -5.0}, {0.3, 1.0}})
    for (const double density : {0.01, 0.1}) {
      const FogParams params{.near = 1, .far = 9, .density = density, .height = FogHeight{height, 1}};
      const Ray ray(params, tilt, 2, 5);
      const auto depths = ray.slabs().depths();
      ASSERT_EQ(depths.size(), 17u) << tilt;
      for (size_t k = 1; k < depths.size(); ++k)
        EXPECT_NEAR((depths[k] - depths[k - 1]) / depths.back(), 1 / 16.0, 1e-5) << tilt;
    }
}

// What is behind 20 optical depths is not cut any more, however thick it is.
TEST(FogSlabs, ThickFogHasFewSlabs) {
  const FogParams params{.near = 1, .far = 9, .density = 1000};
  const DeepImage image = seenFrom(0);
  FogSlabs slabs(image, params);
  slabs.set(4, 3);
  ASSERT_EQ(slabs.borders().size(), 7u);
  for (size_t k = 1; k < 6; ++k) EXPECT_NEAR(slabs.depths()[k], 4.0 * double(k), 0.01);
}

// Of light that comes from within the fog, and of that of an opaque volume, all of which is seen at its front.
TEST(FogSlabs, PassingIsTheMeanOfWhatPassesToEachDepth) {
  Fogs fogs;
  for (int i = 0; i < 300; ++i) {
    FogParams params = fogs.next();
    params.density = fogs.power(-2, 0.5);
    const Ray ray(params, fogs.even(-1.5, 1.5), i % 9, i % 7);
    const double length = params.far - params.near;
    const auto begin = float(params.near + length * fogs.even(-0.3, 1.2));
    const Range range{begin, float(double(begin) + length * fogs.even(0.01, 1))};
    const auto borders = ray.slabs().borders();
    const auto depths = ray.slabs().depths();
    // Evenly within each slab.
    const auto inFront = [&](double z) {
      double depth = 0;
      for (size_t k = 0; k + 1 < borders.size(); ++k) {
        const double from = double(borders[k]), to = double(borders[k + 1]);
        depth += (depths[k + 1] - depths[k]) * (std::clamp(z, from, to) - from) / (to - from);
      }
      return depth;
    };
    EXPECT_NEAR(ray.slabs().passing(begin), std::exp(-inFront(double(begin))), 1e-12) << i;
    EXPECT_NEAR(ray.slabs().passing(range, std::numeric_limits<double>::infinity()), std::exp(-inFront(double(begin))),
                1e-12);
    for (const double own : {0.0, 0.7, 5.0}) {
      double sum = 0, light = 0;
      const int steps = 4000;
      for (int k = 0; k < steps; ++k) {
        const double x = (k + 0.5) / steps, here = std::exp(-own * x);
        sum += here * std::exp(-inFront(double(range.z) + x * (double(range.zBack) - double(range.z))));
        light += here;
      }
      EXPECT_NEAR(ray.slabs().passing(range, own), sum / light, 2e-3) << i << ", " << own;
    }
  }
}

}  // namespace
}  // namespace fathom::deep
