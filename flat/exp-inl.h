// exp(x) for x <= 0, on vectors. Relative error below 3e-7 for x > -87; 0 below that, so a weight that is nothing costs
// nothing.
//
// 2^n * p(f) with x = n ln 2 + f, |f| <= ln 2 / 2: Cody and Waite's reduction and the Taylor polynomial of degree 7.
#if defined(FATHOM_EXP_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef FATHOM_EXP_INL
#undef FATHOM_EXP_INL
#else
#define FATHOM_EXP_INL
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace fathom::flat {
namespace HWY_NAMESPACE {

template <class D, class V>
HWY_INLINE V ExpNegative(D d, V x) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::RebindToSigned<D> di;
  const auto clamped = hn::Max(x, hn::Set(d, -87.0f));
  const auto n = hn::Round(hn::Mul(clamped, hn::Set(d, 1.44269504f)));
  auto f = hn::NegMulAdd(n, hn::Set(d, 0.693145751953125f), clamped);
  f = hn::NegMulAdd(n, hn::Set(d, 1.42860677e-6f), f);
  auto p = hn::Set(d, 1.0f / 720);
  p = hn::MulAdd(p, f, hn::Set(d, 1.0f / 120));
  p = hn::MulAdd(p, f, hn::Set(d, 1.0f / 24));
  p = hn::MulAdd(p, f, hn::Set(d, 1.0f / 6));
  p = hn::MulAdd(p, f, hn::Set(d, 0.5f));
  p = hn::MulAdd(p, f, hn::Set(d, 1.0f));
  p = hn::MulAdd(p, f, hn::Set(d, 1.0f));
  const auto power = hn::BitCast(d, hn::ShiftLeft<23>(hn::Add(hn::ConvertTo(di, n), hn::Set(di, 127))));
  return hn::IfThenElseZero(hn::Gt(x, hn::Set(d, -87.0f)), hn::Mul(p, power));
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::flat
HWY_AFTER_NAMESPACE();

#endif
