// Between groups of channels and planes, for as many pixels as a vector has lanes: two passes of interleaving by four, or
// one by four and one by two.
#if defined(FATHOM_TRANSPOSE_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef FATHOM_TRANSPOSE_INL
#undef FATHOM_TRANSPOSE_INL
#else
#define FATHOM_TRANSPOSE_INL
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace fathom::nn {
namespace HWY_NAMESPACE {

// from[lane * block + channel] to to[channel * Lanes + lane]; block is 8 or 16.
template <class D>
HWY_INLINE void GroupToPlanes(D d, const float* HWY_RESTRICT from, int block, float* HWY_RESTRICT to) {
  namespace hn = hwy::HWY_NAMESPACE;
  const size_t N = hn::Lanes(d), quarters = size_t(block) / 4;
  HWY_ALIGN float part[4][4 * hn::MaxLanes(d)];
  auto a = hn::Zero(d), b = a, c = a, e = a;
  for (size_t k = 0; k < quarters; ++k) {
    hn::LoadInterleaved4(d, from + 4 * N * k, a, b, c, e);
    hn::Store(a, d, part[0] + N * k);
    hn::Store(b, d, part[1] + N * k);
    hn::Store(c, d, part[2] + N * k);
    hn::Store(e, d, part[3] + N * k);
  }
  for (size_t j = 0; j < 4; ++j) {
    if (quarters == 4) {
      hn::LoadInterleaved4(d, part[j], a, b, c, e);
      hn::Store(c, d, to + (8 + j) * N);
      hn::Store(e, d, to + (12 + j) * N);
    } else {
      hn::LoadInterleaved2(d, part[j], a, b);
    }
    hn::Store(a, d, to + j * N);
    hn::Store(b, d, to + (4 + j) * N);
  }
}

// from[channel * Lanes + lane] to to[lane * block + channel].
template <class D>
HWY_INLINE void PlanesToGroup(D d, const float* HWY_RESTRICT from, int block, float* HWY_RESTRICT to) {
  namespace hn = hwy::HWY_NAMESPACE;
  const size_t N = hn::Lanes(d), quarters = size_t(block) / 4;
  HWY_ALIGN float part[4][4 * hn::MaxLanes(d)];
  for (size_t j = 0; j < 4; ++j) {
    const auto a = hn::Load(d, from + j * N), b = hn::Load(d, from + (4 + j) * N);
    if (quarters == 4)
      hn::StoreInterleaved4(a, b, hn::Load(d, from + (8 + j) * N), hn::Load(d, from + (12 + j) * N), d, part[j]);
    else
      hn::StoreInterleaved2(a, b, d, part[j]);
  }
  for (size_t k = 0; k < quarters; ++k)
    hn::StoreInterleaved4(hn::Load(d, part[0] + N * k), hn::Load(d, part[1] + N * k), hn::Load(d, part[2] + N * k),
                          hn::Load(d, part[3] + N * k), d, to + 4 * N * k);
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::nn
HWY_AFTER_NAMESPACE();

#endif
