#include "flat/curve_table.h"

#include <algorithm>
#include <bit>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "flat/curve_table.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// What all instruction sets share.
#ifndef FATHOM_FLAT_CURVE_TABLE
#define FATHOM_FLAT_CURVE_TABLE
namespace fathom::flat::curve {

// The octaves are those of |x| + kBias, so that the first one begins at 0.
inline constexpr float kBias = 0x1p-32f;
inline constexpr uint32_t kFirst = std::bit_cast<uint32_t>(kBias);
inline constexpr int kRest = 14;  // bits of a place between two points
inline constexpr uint32_t kRestMask = (1u << kRest) - 1;
inline constexpr float kRestScale = 1.0f / (1u << kRest);
inline constexpr int kPoints = 48 * (1 << (23 - kRest)) + 1;  // of a sign, up to 2^16

}  // namespace fathom::flat::curve
#endif

HWY_BEFORE_NAMESPACE();
namespace fathom::flat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The steps of 8 bits of one channel; no contraction, so that all instruction sets agree.
template <class D>
hn::Vec<hn::RebindToSigned<D>> Steps(D d, const float* values, const float* from) {
  using namespace curve;
  const hn::RebindToSigned<D> di;
  const auto x = hn::LoadU(d, from);
  const auto place = hn::Sub(hn::BitCast(di, hn::Add(hn::Abs(x), hn::Set(d, kBias))), hn::Set(di, int32_t(kFirst)));
  const auto negative = hn::And(hn::BroadcastSignBit(hn::BitCast(di, x)), hn::Set(di, int32_t(kPoints)));
  const auto index = hn::Add(hn::ShiftRight<kRest>(place), negative);
  const auto a = hn::GatherIndex(d, values, index), b = hn::GatherIndex(d, values + 1, index);
  const auto along = hn::Mul(hn::ConvertTo(d, hn::And(place, hn::Set(di, int32_t(kRestMask)))), hn::Set(d, kRestScale));
  const auto y = hn::Add(a, hn::Mul(along, hn::Sub(b, a)));
  const auto inside = hn::Min(hn::Max(y, hn::Zero(d)), hn::Set(d, 1.0f));
  return hn::ConvertTo(di, hn::Add(hn::Mul(inside, hn::Set(d, 255.0f)), hn::Set(d, 0.5f)));
}

// Whole vectors alone; returns how many pixels that are.
size_t LookUpPixels(const std::array<const float*, 3>& values, const std::array<const float*, 3>& rgb, size_t pixels,
                    uint32_t* to) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::RebindToUnsigned<decltype(d)> du;
  const size_t N = hn::Lanes(d);
  size_t x = 0;
  for (; x + N <= pixels; x += N) {
    const auto red = Steps(d, values[0], rgb[0] + x), green = Steps(d, values[1], rgb[1] + x),
               blue = Steps(d, values[2], rgb[2] + x);
    const auto packed = hn::Or(hn::Or(hn::ShiftLeft<16>(red), hn::ShiftLeft<8>(green)), blue);
    hn::StoreU(hn::BitCast(du, hn::Or(packed, hn::Set(di, int32_t(0xff000000u)))), du, to + x);
  }
  return x;
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::flat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fathom::flat {

HWY_EXPORT(LookUpPixels);

using namespace curve;

float CurveTable::operator()(float x) const {
  const uint32_t place = std::bit_cast<uint32_t>(std::abs(x) + kBias) - kFirst;
  const float* from = values_.data() + (std::signbit(x) ? kPoints : 0) + (place >> kRest);
  const float along = float(int32_t(place & kRestMask)) * kRestScale;
  return std::min(std::max(0.0f, from[0] + along * (from[1] - from[0])), 1.0f);
}

std::optional<CurveTable> CurveTable::make(const std::function<void(std::span<float>)>& evaluate, float tolerance) {
  // Points and, between them, the middles of lines; of positive numbers and then of negative ones.
  constexpr size_t kBoth = 2 * size_t(kPoints) - 1;
  std::vector<float> values(2 * kBoth);
  for (size_t i = 0; i < kBoth; ++i) {
    values[i] = std::bit_cast<float>(kFirst + (uint32_t(i) << (kRest - 1))) - kBias;
    values[kBoth + i] = -values[i];
  }
  evaluate(values);
  for (float& value : values) value = std::clamp(value, -1.0f, 2.0f);  // NaN stays
  CurveTable table;
  table.values_.reserve(2 * size_t(kPoints));
  for (const size_t sign : {size_t(0), kBoth}) {
    const float* at = values.data() + sign;
    for (size_t i = 0; i < kBoth; i += 2) table.values_.push_back(at[i]);
    for (size_t i = 1; i < kBoth; i += 2) {
      const float line = 0.5f * (at[i - 1] + at[i + 1]);
      if (!(std::abs(std::clamp(line, 0.0f, 1.0f) - std::clamp(at[i], 0.0f, 1.0f)) <= tolerance)) return {};
    }
  }
  return table;
}

void lookUpPixels(const std::array<const CurveTable*, 3>& tables, const std::array<const float*, 3>& rgb, size_t pixels,
                  uint32_t* to) {
  const std::array<const float*, 3> values{tables[0]->values().data(), tables[1]->values().data(),
                                           tables[2]->values().data()};
  const auto step = [&](size_t c, size_t x) { return uint32_t(int32_t((*tables[c])(rgb[c][x]) * 255 + 0.5f)); };
  for (size_t x = HWY_DYNAMIC_DISPATCH(LookUpPixels)(values, rgb, pixels, to); x < pixels; ++x)
    to[x] = 0xff000000u | step(0, x) << 16 | step(1, x) << 8 | step(2, x);
}

}  // namespace fathom::flat
#endif
