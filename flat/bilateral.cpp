#include "flat/bilateral.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "flat/bilateral.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "flat/exp-inl.h"

HWY_BEFORE_NAMESPACE();
namespace fathom::flat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// kSquared: weights are squared in the sums, and the sums divided by the square of the sum of weights.
template <bool kSquared>
void BilateralRow(int y, int width, const BilateralParams& params, const uint8_t* wanted, std::span<const Padded> guide,
                  std::span<const Padded> in, std::span<Padded> out) {
  const hn::ScalableTag<float> d;
  const int N = int(hn::Lanes(d));
  const int R = params.radius;
  const float fall = -0.5f / (params.sigma * params.sigma);
  constexpr size_t kMost = 4;
  for (int x = 0; x < width; x += N) {
    if (std::none_of(wanted + x, wanted + std::min(x + N, width), [](uint8_t w) { return w != 0; })) {
      for (Padded& plane : out) hn::StoreU(hn::Zero(d), d, plane.row(y) + x);
      continue;
    }
    auto weight = hn::Zero(d);
    hn::Vec<decltype(d)> sum[kMost] = {hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
    for (int dy = -R; dy <= R; ++dy) {
      for (int dx = -R; dx <= R; ++dx) {
        auto distance = hn::Zero(d);
        for (const Padded& g : guide) {
          const auto a = hn::LoadU(d, g.row(y) + x), b = hn::LoadU(d, g.row(y + dy) + x + dx);
          const auto e = hn::Sub(a, b);
          const auto scale = hn::MulAdd(a, a, hn::MulAdd(b, b, hn::Set(d, params.floor)));
          distance = hn::Add(distance, hn::Div(hn::Mul(e, e), scale));
        }
        const auto exponent =
            hn::NegMulAdd(distance, hn::Set(d, params.sharpness), hn::Set(d, fall * float(dx * dx + dy * dy)));
        const auto w = ExpNegative(d, exponent);
        weight = hn::Add(weight, w);
        const auto part = kSquared ? hn::Mul(w, w) : w;
        for (size_t i = 0; i < in.size(); ++i)
          sum[i] = hn::MulAdd(part, hn::LoadU(d, in[i].row(y + dy) + x + dx), sum[i]);
      }
    }
    const auto whole = kSquared ? hn::Mul(weight, weight) : weight;
    for (size_t i = 0; i < in.size(); ++i) hn::StoreU(hn::Div(sum[i], whole), d, out[i].row(y) + x);
  }
}

void BilateralMean(int y, int width, const BilateralParams& params, const uint8_t* wanted,
                   std::span<const Padded> guide, std::span<const Padded> in, std::span<Padded> out) {
  BilateralRow<false>(y, width, params, wanted, guide, in, out);
}

void BilateralVariance(int y, int width, const BilateralParams& params, const uint8_t* wanted,
                       std::span<const Padded> guide, std::span<const Padded> in, std::span<Padded> out) {
  BilateralRow<true>(y, width, params, wanted, guide, in, out);
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::flat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fathom::flat {

HWY_EXPORT(BilateralMean);
HWY_EXPORT(BilateralVariance);

void bilateral(int width, int height, const BilateralParams& params, const Buffer<uint8_t>& wanted,
               std::span<const Padded> guide, std::span<const Padded> in, std::span<Padded> out) {
  parallelFor(0, height, [&](int y) {
    HWY_DYNAMIC_DISPATCH(BilateralMean)(y, width, params, wanted.data() + size_t(y) * size_t(width), guide, in, out);
  });
}

void bilateralVariance(int width, int height, const BilateralParams& params, const Buffer<uint8_t>& wanted,
                       std::span<const Padded> guide, std::span<const Padded> in, std::span<Padded> out) {
  parallelFor(0, height, [&](int y) {
    HWY_DYNAMIC_DISPATCH(BilateralVariance)
    (y, width, params, wanted.data() + size_t(y) * size_t(width), guide, in, out);
  });
}

}  // namespace fathom::flat
#endif
