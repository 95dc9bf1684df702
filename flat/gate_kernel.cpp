#include "flat/gate_kernel.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "flat/gate_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "flat/alike-inl.h"

HWY_BEFORE_NAMESPACE();
namespace fathom::flat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

GateVerdict TakenBack(const GateSample& here, GateNeighbours& n, float threshold, float floor) {
  const hn::ScalableTag<float> d;
  const size_t N = hn::Lanes(d);
  auto weight = hn::Zero(d), square = hn::Zero(d);
  hn::Vec<decltype(d)> residual[3] = {weight, weight, weight}, variance[3] = {weight, weight, weight};
  for (size_t i = n.count; i % N != 0; ++i)
    for (auto& plane : n.value) plane[i] = 0;
  for (size_t i = 0; i < n.count; i += N) {
    const auto alike = Alike(d, here.filtered, n.value, i, floor);
    const auto perSample = hn::Mul(alike, hn::Load(d, n.value[10] + i));
    const auto u = hn::Mul(perSample, hn::Load(d, n.value[3] + i));
    weight = hn::Add(weight, u);
    square = hn::MulAdd(u, perSample, square);
    for (size_t c = 0; c < 3; ++c) {
      residual[c] = hn::MulAdd(u, hn::Load(d, n.value[4 + c] + i), residual[c]);
      variance[c] = hn::MulAdd(u, hn::Load(d, n.value[7 + c] + i), variance[c]);
    }
  }
  const auto sum = [&](auto v) HWY_ATTR { return hn::GetLane(hn::SumOfLanes(d, v)); };
  const float u = sum(weight), u2 = sum(square);
  GateVerdict verdict;
  if (!(u > 0)) return verdict;
  float biased = 0, all = 0;
  for (size_t c = 0; c < 3; ++c) {
    const float m = sum(residual[c]) / u, s2 = sum(variance[c]) / u;
    const float bias2 = std::max(0.0f, m * m - threshold * s2 * (u2 / u / u));
    verdict.noise[c] = s2 / here.samples;
    verdict.bias2[c] = bias2;
    biased += bias2;
    all += bias2 + verdict.noise[c];
  }
  if (all > 0 && biased <= all) verdict.k = biased / all;
  return verdict;
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::flat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fathom::flat {

HWY_EXPORT(TakenBack);

GateVerdict takenBack(const GateSample& here, GateNeighbours& neighbours, float threshold, float floor) {
  return HWY_DYNAMIC_DISPATCH(TakenBack)(here, neighbours, threshold, floor);
}

}  // namespace fathom::flat
#endif
