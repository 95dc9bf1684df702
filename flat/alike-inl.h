// How alike neighbouring colours are, for the kernels that average over neighbours. Included once per target, between
// HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE includes as Highway's -inl headers are.
#if defined(FATHOM_FLAT_ALIKE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef FATHOM_FLAT_ALIKE_INL_H_
#undef FATHOM_FLAT_ALIKE_INL_H_
#else
#define FATHOM_FLAT_ALIKE_INL_H_
#endif

#include <hwy/highway.h>

#include "flat/exp-inl.h"

HWY_BEFORE_NAMESPACE();
namespace fathom::flat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// exp(-4 sum_c (there_c - here_c)^2 / (there_c^2 + here_c^2 + floor)) of a vector of colours from `i` on in three planes.
template <class D, class Planes>
hn::Vec<D> Alike(D d, const float* HWY_RESTRICT here, const Planes& planes, size_t i, float floor) {
  constexpr float kSharpness = 4;
  auto distance = hn::Zero(d);
  for (size_t c = 0; c < 3; ++c) {
    const auto mine = hn::Set(d, here[c]);
    const auto there = hn::Load(d, planes[c] + i);
    const auto e = hn::Sub(there, mine);
    const auto scale = hn::MulAdd(there, there, hn::MulAdd(mine, mine, hn::Set(d, floor)));
    distance = hn::Add(distance, hn::Div(hn::Mul(e, e), scale));
  }
  return ExpNegative(d, hn::Mul(distance, hn::Set(d, -kSharpness)));
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::flat
HWY_AFTER_NAMESPACE();

#endif
