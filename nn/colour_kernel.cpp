#include "nn/colour_kernel.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/colour_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <hwy/contrib/math/math-inl.h>

HWY_BEFORE_NAMESPACE();
namespace fathom::nn {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Of a count that is a multiple of 64.
void LogPlusOne(const float* HWY_RESTRICT from, size_t count, float* HWY_RESTRICT to) {
  const hn::ScalableTag<float> d;
  for (size_t i = 0; i < count; i += hn::Lanes(d)) hn::StoreU(hn::Log1p(d, hn::LoadU(d, from + i)), d, to + i);
}

// As splitColour, for 64 values of one channel: `mask` holds their logits.
void Split(const float* HWY_RESTRICT mask, const float* HWY_RESTRICT colour, float* HWY_RESTRICT first,
           float* HWY_RESTRICT second) {
  const hn::ScalableTag<float> d;
  const auto one = hn::Set(d, 1.0f), most = hn::Set(d, 80.0f);
  for (size_t i = 0; i < 64; i += hn::Lanes(d)) {
    const auto x = hn::Clamp(hn::Neg(hn::LoadU(d, mask + i)), hn::Neg(most), most), c = hn::LoadU(d, colour + i);
    const auto part = hn::Mul(hn::Div(one, hn::Add(one, hn::Exp(d, x))), c);
    hn::StoreU(part, d, first + i);
    hn::StoreU(hn::Sub(c, part), d, second + i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::nn
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fathom::nn {

HWY_EXPORT(LogPlusOne);
HWY_EXPORT(Split);

namespace {

constexpr size_t kTile = 64;

}  // namespace

void logColour(const float* from, size_t count, Element element, std::byte* to) {
  const auto logPlusOne = HWY_DYNAMIC_DISPATCH(LogPlusOne);
  float in[kTile] = {}, out[kTile];
  for (size_t i = 0; i < count; i += kTile) {
    const size_t n = std::min(kTile, count - i);
    std::copy_n(from + i, n, in);
    logPlusOne(in, kTile, out);
    if (element == Element::float32)
      std::copy_n(out, n, reinterpret_cast<float*>(to) + i);
    else
      toBfloat16(out, n, reinterpret_cast<uint16_t*>(to) + i);
  }
}

void splitColour(const float* logits, int block, const float* colour, size_t pixels, float* first, float* second) {
  const auto split = HWY_DYNAMIC_DISPATCH(Split);
  float mask[kTile] = {}, in[kTile] = {}, a[kTile], b[kTile];
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < pixels; i += kTile) {
      const size_t n = std::min(kTile, pixels - i), at = c * pixels + i;
      for (size_t k = 0; k < n; ++k) mask[k] = logits[(i + k) * size_t(block) + c];
      std::copy_n(colour + at, n, in);
      split(mask, in, a, b);
      std::copy_n(a, n, first + at);
      std::copy_n(b, n, second + at);
    }
}

}  // namespace fathom::nn
#endif
