#include "deep/gate.h"

#include <cmath>

#include "flat/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "deep/gate.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "flat/exp-inl.h"

#ifndef FATHOM_GATE_ONCE
#define FATHOM_GATE_ONCE
namespace fathom::deep {

// The neighbours of one bin, a plane per value.
struct GateNeighbours {
  static constexpr size_t kMost = 64;  // 49, in whole vectors
  alignas(64) float value[11][kMost];  // filtered 0-2, samples 3, residual 4-6, variance 7-9, reach 10
  size_t count = 0;
};

}  // namespace fathom::deep
#endif

HWY_BEFORE_NAMESPACE();
namespace fathom::deep {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// k of a bin from its neighbours; equal to the formulas in gate.h.
float GateOf(const GateBin& bin, GateNeighbours& n, float floor) {
  constexpr float kSharpness = 4;
  const hn::ScalableTag<float> d;
  const size_t N = hn::Lanes(d);
  auto weight = hn::Zero(d), square = hn::Zero(d);
  hn::Vec<decltype(d)> residual[3] = {weight, weight, weight}, variance[3] = {weight, weight, weight};
  for (size_t i = n.count; i % N != 0; ++i)
    for (auto& plane : n.value) plane[i] = 0;
  for (size_t i = 0; i < n.count; i += N) {
    auto distance = hn::Zero(d);
    for (size_t c = 0; c < 3; ++c) {
      const auto here = hn::Set(d, bin.filtered[c]);
      const auto there = hn::Load(d, n.value[c] + i);
      const auto e = hn::Sub(there, here);
      const auto scale = hn::MulAdd(there, there, hn::MulAdd(here, here, hn::Set(d, floor)));
      distance = hn::Add(distance, hn::Div(hn::Mul(e, e), scale));
    }
    const auto alike = flat::HWY_NAMESPACE::ExpNegative(d, hn::Mul(distance, hn::Set(d, -kSharpness)));
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
  if (!(u > 0)) return 0;
  float biased = 0, all = 0;
  for (size_t c = 0; c < 3; ++c) {
    const float m = sum(residual[c]) / u, s2 = sum(variance[c]) / u;
    const float bias2 = std::max(0.0f, m * m - 2 * s2 * (u2 / u / u));
    biased += bias2;
    all += bias2 + s2 / bin.samples;
  }
  return all > 0 && biased <= all ? biased / all : 0;
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::deep
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fathom::deep {
namespace {

HWY_EXPORT(GateOf);

constexpr float kSameDepth = 0.02f;  // |log z - log z'| of neighbours
constexpr float kReach = 5;          // exp(-|offset|^2 / kReach)
constexpr float kFloor = 4e-4f;      // of the squared mean colour: 1e-4 where that is 0.5

// The bin of [begin, end) nearest to depth z, or `end` where none is near enough.
size_t nearest(const float* depth, size_t begin, size_t end, float z) {
  size_t best = end;
  float least = kSameDepth;
  for (size_t d = begin; d < end; ++d) {
    const float e = std::fabs(depth[d] - z);
    if (e <= least) {
      least = e;
      best = d;
    }
  }
  return best;
}

void findNeighbours(const DenoiseData& data, const Buffer<GateBin>& bins, int x, int y, size_t bin,
                    const std::array<float, 2 * kGateRadius + 1>& reach, GateNeighbours& result) {
  const float* depth = data.depth.value[0].data();
  const int x0 = std::max(0, x - kGateRadius), x1 = std::min(data.width - 1, x + kGateRadius);
  result.count = 0;
  for (int yq = std::max(0, y - kGateRadius); yq <= std::min(data.height - 1, y + kGateRadius); ++yq) {
    const uint64_t* offsets = data.offsets + size_t(yq) * size_t(data.width);
    for (int xq = x0; xq <= x1; ++xq) {
      const size_t end = size_t(offsets[xq + 1]);
      const size_t d = nearest(depth, size_t(offsets[xq]), end, depth[bin]);
      if (d == end || !(bins[d].samples > 0)) continue;
      const GateBin& from = bins[d];
      const size_t i = result.count++;
      for (size_t c = 0; c < 3; ++c) {
        result.value[c][i] = from.filtered[c];
        result.value[4 + c][i] = from.residual[c];
        result.value[7 + c][i] = from.variance[c];
      }
      result.value[3][i] = from.samples;
      result.value[10][i] = reach[size_t(yq - y + kGateRadius)] * reach[size_t(xq - x + kGateRadius)];
    }
  }
}

}  // namespace

Buffer<float> gate(const DenoiseData& data, const Buffer<GateBin>& bins, const Buffer<uint8_t>& still, float level) {
  Buffer<float> result(data.bins(), 0.0f);
  const float floor = kFloor * level * level;
  std::array<float, 2 * kGateRadius + 1> reach;
  for (int i = -kGateRadius; i <= kGateRadius; ++i) reach[size_t(i + kGateRadius)] = std::exp(-float(i * i) / kReach);
  parallelFor(0, data.height, [&](int y) {
    GateNeighbours neighbours;
    for (int x = 0; x < data.width; ++x) {
      const size_t pixel = size_t(y) * size_t(data.width) + size_t(x);
      if (still[pixel]) continue;
      for (size_t b = size_t(data.offsets[pixel]); b < size_t(data.offsets[pixel + 1]); ++b) {
        if (!(bins[b].samples > 0)) continue;
        findNeighbours(data, bins, x, y, b, reach, neighbours);
        result[b] = HWY_DYNAMIC_DISPATCH(GateOf)(bins[b], neighbours, floor);
      }
    }
  });
  return result;
}

}  // namespace fathom::deep
#endif
