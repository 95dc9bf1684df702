#include "flat/mix_kernel.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "flat/mix_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "flat/alike-inl.h"

HWY_BEFORE_NAMESPACE();
namespace fathom::flat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

float MixShare(const MixSample& here, MixNeighbours& n, const MixParams& params, float floor) {
  const hn::ScalableTag<float> d;
  const size_t N = hn::Lanes(d);
  auto weight = hn::Zero(d), product = hn::Zero(d), square = hn::Zero(d), variance = hn::Zero(d);
  for (size_t i = n.count; i % N != 0; ++i)
    for (auto& plane : n.value) plane[i] = 0;
  for (size_t i = 0; i < n.count; i += N) {
    const auto reach = hn::Mul(hn::Load(d, n.value[13] + i), hn::Load(d, n.value[3] + i));
    const auto u = hn::Mul(reach, Alike(d, here.mean, n.value, i, floor));
    weight = hn::Add(weight, u);
    for (size_t c = 0; c < 3; ++c) {
      const auto difference = hn::Load(d, n.value[4 + c] + i);
      const auto weighted = hn::Mul(u, difference);
      product = hn::MulAdd(weighted, hn::Load(d, n.value[7 + c] + i), product);
      square = hn::MulAdd(weighted, difference, square);
      variance = hn::MulAdd(u, hn::Load(d, n.value[10 + c] + i), variance);
    }
  }
  const auto sum = [&](auto v) HWY_ATTR { return hn::GetLane(hn::SumOfLanes(d, v)); };
  const float u = sum(weight);
  if (!(u > 0)) return params.prior;
  const float noise = params.strength * (sum(variance) / u), all = sum(square) + noise;
  const float share = (sum(product) + noise * params.prior) / all;
  return all > 0 && share == share ? std::clamp(share, 0.0f, 1.0f) : params.prior;
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::flat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fathom::flat {

HWY_EXPORT(MixShare);

float mixShare(const MixSample& here, MixNeighbours& neighbours, const MixParams& params, float floor) {
  return HWY_DYNAMIC_DISPATCH(MixShare)(here, neighbours, params, floor);
}

}  // namespace fathom::flat
#endif
