// The vector exponential against the library's, for every instruction set.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/buffer.h"
#include "tests/reference/simd_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/flat/exp_test.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "flat/exp-inl.h"

HWY_BEFORE_NAMESPACE();
namespace fathom::flat {
namespace HWY_NAMESPACE {

// Of a count that is a multiple of 64.
void ExpAll(const float* in, float* out, size_t count) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  for (size_t i = 0; i < count; i += hn::Lanes(d)) hn::StoreU(ExpNegative(d, hn::LoadU(d, in + i)), d, out + i);
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::flat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fathom::flat {
namespace {

HWY_EXPORT(ExpAll);

TEST(ExpNegative, IsTheExponential) {
  constexpr size_t kCount = 1 << 20;
  Buffer<float> in(kCount), out(kCount);
  for (size_t i = 0; i < kCount; ++i) in[i] = -86.99f * float(i) / float(kCount - 1);
  for (size_t i = 0; i < 40; ++i) in[i] = -std::ldexp(1.0f, -int(i));  // next to 0 as well
  forSimdTargets([&] {
    HWY_DYNAMIC_DISPATCH(ExpAll)(in.data(), out.data(), kCount);
    double worst = 0;
    for (size_t i = 0; i < kCount; ++i) {
      const double expected = std::exp(double(in[i]));
      worst = std::max(worst, std::fabs(double(out[i]) - expected) / expected);
    }
    EXPECT_LT(worst, 3e-7);
  });
}

TEST(ExpNegative, IsOneAtZeroAndNothingFarBelow) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const float odd[] = {0.0f, -0.0f, -87.5f, -1000.0f, -1e30f, -kInfinity, std::numeric_limits<float>::quiet_NaN()};
  const float expected[] = {1, 1, 0, 0, 0, 0, 0};
  forSimdTargets([&] {
    Buffer<float> in(64, 0.0f), out(64);
    std::copy(std::begin(odd), std::end(odd), in.begin());
    HWY_DYNAMIC_DISPATCH(ExpAll)(in.data(), out.data(), 64);
    for (size_t i = 0; i < std::size(odd); ++i) EXPECT_EQ(out[i], expected[i]) << odd[i];
  });
}

}  // namespace
}  // namespace fathom::flat
#endif
