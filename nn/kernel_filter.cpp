#include "nn/kernel_filter.h"

#include <algorithm>
#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernel_filter.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <hwy/contrib/math/math-inl.h>

#include "nn/transpose-inl.h"

HWY_BEFORE_NAMESPACE();
namespace fathom::nn {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::ScalableTag<float>;
using V = hn::Vec<D>;

HWY_INLINE V Sigmoid(D d, V x) {
  const V one = hn::Set(d, 1.0f), most = hn::Set(d, 80.0f);
  return hn::Div(one, hn::Add(one, hn::Exp(d, hn::Clamp(hn::Neg(x), hn::Neg(most), most))));
}

// Softmax and gather for one vector of pixels. `logits`: a vector a channel; `rows`: the first pixel of each plane,
// in the row of the pixels.
HWY_INLINE void FilterPixels(const float* HWY_RESTRICT logits, const float* const* rows, ptrdiff_t stride, V* result) {
  const D d;
  const size_t N = hn::Lanes(d);
  V most = hn::Load(d, logits);
  for (size_t k = 1; k < kKernelTaps; ++k) most = hn::Max(most, hn::Load(d, logits + k * N));
  V total = hn::Zero(d), sum[3] = {total, total, total};
  for (ptrdiff_t dy = 0; dy < kKernelWidth; ++dy)
    for (ptrdiff_t dx = 0; dx < kKernelWidth; ++dx) {
      const V weight = hn::Exp(d, hn::Sub(hn::Load(d, logits + size_t(dy * kKernelWidth + dx) * N), most));
      const ptrdiff_t to = (dy - kKernelWidth / 2) * stride + dx - kKernelWidth / 2;
      total = hn::Add(total, weight);
      for (int c = 0; c < 3; ++c) sum[c] = hn::MulAdd(weight, hn::LoadU(d, rows[c] + to), sum[c]);
    }
  const V scale = hn::Div(hn::Set(d, 1.0f), total);
  for (int c = 0; c < 3; ++c) result[c] = hn::Mul(sum[c], scale);
}

// One row. `logits`: its first group; the others are `groupStride` floats further each.
void FilterRow(const float* HWY_RESTRICT logits, size_t groupStride, int block, const float* const* rows,
               ptrdiff_t stride, size_t width, float* const* filtered, float* HWY_RESTRICT alpha) {
  const D d;
  const size_t N = hn::Lanes(d), group = size_t(block), groups = 32 / group;
  HWY_ALIGN float planes[32 * hn::MaxLanes(d)];
  HWY_ALIGN float padded[16 * hn::MaxLanes(d)];
  HWY_ALIGN float last[4][hn::MaxLanes(d)];
  for (size_t x = 0; x < width; x += N) {
    const size_t count = std::min(N, width - x);
    for (size_t g = 0; g < groups; ++g) {
      const float* from = logits + g * groupStride + x * group;
      if (count < N) {
        std::fill(std::copy_n(from, count * group, padded), padded + N * group, 0.0f);
        from = padded;
      }
      GroupToPlanes(d, from, block, planes + g * group * N);
    }
    const float* here[3] = {rows[0] + x, rows[1] + x, rows[2] + x};
    V result[3];
    FilterPixels(planes, here, stride, result);
    const V a = Sigmoid(d, hn::Load(d, planes + size_t(kKernelTaps) * N));
    if (count == N) {
      for (int c = 0; c < 3; ++c) hn::StoreU(result[c], d, filtered[c] + x);
      if (alpha) hn::StoreU(a, d, alpha + x);
      continue;
    }
    for (int c = 0; c < 3; ++c) hn::Store(result[c], d, last[c]);
    hn::Store(a, d, last[3]);
    for (int c = 0; c < 3; ++c) std::copy_n(last[c], count, filtered[c] + x);
    if (alpha) std::copy_n(last[3], count, alpha + x);
  }
}

// The means of 2x2 pixels of two rows; `width` is that of the result.
void HalveRow(const float* HWY_RESTRICT upper, const float* HWY_RESTRICT lower, size_t width, float* HWY_RESTRICT to) {
  const D d;
  const size_t N = hn::Lanes(d);
  const V quarter = hn::Set(d, 0.25f);
  size_t x = 0;
  for (; x + N <= width; x += N) {
    V a = hn::Zero(d), b = a, c = a, e = a;
    hn::LoadInterleaved2(d, upper + 2 * x, a, b);
    hn::LoadInterleaved2(d, lower + 2 * x, c, e);
    hn::StoreU(hn::Mul(hn::Add(hn::Add(a, b), hn::Add(c, e)), quarter), d, to + x);
  }
  for (; x < width; ++x) to[x] = ((upper[2 * x] + upper[2 * x + 1]) + (lower[2 * x] + lower[2 * x + 1])) * 0.25f;
}

// fine += alpha * U(the two rows of the difference, of which `near` weighs 3/4). `mixed` and `enlarged` are scratch with
// room for vectors; `width` is that of the difference.
void EnlargeRow(const float* HWY_RESTRICT near, const float* HWY_RESTRICT far, size_t width,
                const float* HWY_RESTRICT alpha, float* HWY_RESTRICT mixed, float* HWY_RESTRICT enlarged,
                float* HWY_RESTRICT fine) {
  const D d;
  const size_t N = hn::Lanes(d);
  const V much = hn::Set(d, 0.75f), little = hn::Set(d, 0.25f);
  float* row = mixed + N;  // room for the pixel on the left
  size_t x = 0;
  for (; x + N <= width; x += N)
    hn::StoreU(hn::MulAdd(much, hn::LoadU(d, near + x), hn::Mul(little, hn::LoadU(d, far + x))), d, row + x);
  for (; x < width; ++x) row[x] = 0.75f * near[x] + 0.25f * far[x];
  row[-1] = row[0];
  std::fill_n(row + width, N + 1, row[width - 1]);
  for (x = 0; x < width; x += N) {
    const V here = hn::Mul(much, hn::LoadU(d, row + x));
    hn::StoreInterleaved2(hn::MulAdd(little, hn::LoadU(d, row + x - 1), here),
                          hn::MulAdd(little, hn::LoadU(d, row + x + 1), here), d, enlarged + 2 * x);
  }
  for (x = 0; x + N <= 2 * width; x += N)
    hn::StoreU(hn::MulAdd(hn::LoadU(d, alpha + x), hn::LoadU(d, enlarged + x), hn::LoadU(d, fine + x)), d, fine + x);
  for (; x < 2 * width; ++x) fine[x] += alpha[x] * enlarged[x];
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::nn
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fathom::nn {

HWY_EXPORT(FilterRow);
HWY_EXPORT(HalveRow);
HWY_EXPORT(EnlargeRow);

namespace {

constexpr int kColours = 3;
constexpr int kSlack = 64;  // more floats than any vector has

}  // namespace

void BorderedColour::resize(int height, int width) {
  height_ = height;
  width_ = width;
  stride_ = (width + 2 * kBorder + kSlack + 15) / 16 * 16;
  const size_t needed = size_t(kColours) * size_t(height + 2 * kBorder) * size_t(stride_);
  if (values_.size() < needed) values_ = Buffer<float>(needed);
}

void BorderedColour::extend() {
  for (int c = 0; c < kColours; ++c) {
    for (int y = 0; y < height_; ++y) {
      float* r = row(c, y);
      std::fill(r - kBorder, r, r[0]);
      std::fill(r + width_, r - kBorder + stride_, r[width_ - 1]);
    }
    for (int y = 1; y <= kBorder; ++y) {
      std::copy_n(row(c, 0) - kBorder, stride_, row(c, -y) - kBorder);
      std::copy_n(row(c, height_ - 1) - kBorder, stride_, row(c, height_ - 1 + y) - kBorder);
    }
  }
}

void filterColour(const float* logits, int block, const BorderedColour& colour, const Planes& filtered, float* alpha) {
  const size_t width = size_t(colour.width()), rowFloats = width * size_t(block);
  const size_t groupStride = size_t(colour.height()) * rowFloats;
  const auto filter = HWY_DYNAMIC_DISPATCH(FilterRow);
  for (int y = 0; y < colour.height(); ++y) {
    const float* rows[kColours];
    float* to[kColours];
    for (int c = 0; c < kColours; ++c) {
      rows[c] = colour.row(c, y);
      to[c] = filtered.row(size_t(c), y);
    }
    filter(logits + size_t(y) * rowFloats, groupStride, block, rows, colour.stride(), width, to,
           alpha ? alpha + size_t(y) * width : nullptr);
  }
}

void halve(const ConstPlanes& from, int height, int width, const Planes& to) {
  const auto halveRow = HWY_DYNAMIC_DISPATCH(HalveRow);
  for (size_t c = 0; c < from.plane.size(); ++c)
    for (int y = 0; y < height / 2; ++y)
      halveRow(from.row(c, 2 * y), from.row(c, 2 * y + 1), size_t(width / 2), to.row(c, y));
}

void addEnlarged(const Planes& fine, int height, int width, const float* alpha, ptrdiff_t alphaStride,
                 const ConstPlanes& coarse) {
  const int halfHeight = height / 2;
  const size_t halfWidth = size_t(width / 2);
  std::vector<float> mixed(halfWidth + 3 * kSlack), enlarged(2 * (halfWidth + kSlack));
  const auto enlargeRow = HWY_DYNAMIC_DISPATCH(EnlargeRow);
  for (size_t c = 0; c < fine.plane.size(); ++c)
    for (int y = 0; y < height; ++y) {
      const int far = std::clamp(y % 2 ? y / 2 + 1 : y / 2 - 1, 0, halfHeight - 1);
      enlargeRow(coarse.row(c, y / 2), coarse.row(c, far), halfWidth, alpha + y * alphaStride, mixed.data(),
                 enlarged.data(), fine.row(c, y));
    }
}

void addCoarse(const Planes& fine, int height, int width, const float* alpha, const Planes& coarse) {
  const size_t halfWidth = size_t(width / 2);
  std::vector<float> mean(halfWidth);
  const auto halveRow = HWY_DYNAMIC_DISPATCH(HalveRow);
  for (size_t c = 0; c < kColours; ++c)
    for (int y = 0; y < height / 2; ++y) {
      halveRow(fine.row(c, 2 * y), fine.row(c, 2 * y + 1), halfWidth, mean.data());
      float* difference = coarse.row(c, y);
      for (size_t x = 0; x < halfWidth; ++x) difference[x] -= mean[x];
    }
  addEnlarged(fine, height, width, alpha, width, {{coarse.plane.begin(), coarse.plane.end()}, coarse.stride});
}

}  // namespace fathom::nn
#endif
