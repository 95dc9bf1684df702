#include "nn/layers_kernel.h"

#include <algorithm>
#include <array>

#include "nn/kernel_filter.h"
#include "nn/layers_graphs.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/layers_kernel.cpp"
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

// One group of addWeighted.
void AddGroup(const float* HWY_RESTRICT values, size_t block, const float* HWY_RESTRICT weight,
              const uint32_t* HWY_RESTRICT pixel, size_t count, float* HWY_RESTRICT sums) {
  const hn::CappedTag<float, 8> d;  // the smallest block
  for (size_t i = 0; i < count; ++i) {
    if (weight[i] == 0) continue;
    const auto w = hn::Set(d, weight[i]);
    float* to = sums + size_t(pixel[i]) * block;
    for (size_t c = 0; c < block; c += hn::Lanes(d))
      hn::StoreU(hn::MulAdd(w, hn::LoadU(d, values + i * block + c), hn::LoadU(d, to + c)), d, to + c);
  }
}

// The logits, planar as the shares that replace them.
void Shares(size_t count, size_t layers, float* HWY_RESTRICT planes, size_t stride) {
  const D d;
  const V little = hn::Set(d, 0.01f), one = hn::Set(d, 1.0f);
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    V most = hn::LoadU(d, planes + i), total = hn::Zero(d), rest = hn::Zero(d);
    for (size_t l = 1; l < layers; ++l) most = hn::Max(most, hn::LoadU(d, planes + l * stride + i));
    for (size_t l = 0; l < layers; ++l) {
      const V e = hn::Exp(d, hn::Max(hn::Sub(hn::LoadU(d, planes + l * stride + i), most), hn::Set(d, -80.0f)));
      total = hn::Add(total, e);
      hn::StoreU(e, d, planes + l * stride + i);
    }
    const V scale = hn::Div(one, total);
    for (size_t l = 0; l < layers; ++l) {
      const V q = hn::Max(hn::MulSub(hn::LoadU(d, planes + l * stride + i), scale, little), hn::Zero(d));
      rest = hn::Add(rest, q);
      hn::StoreU(q, d, planes + l * stride + i);
    }
    const V whole = hn::Div(one, rest);
    for (size_t l = 0; l < layers; ++l)
      hn::StoreU(hn::Mul(hn::LoadU(d, planes + l * stride + i), whole), d, planes + l * stride + i);
  }
}

// Two rows of one group to one; `width` is that of the result.
void HalveGroupRow(const float* HWY_RESTRICT upper, const float* HWY_RESTRICT lower, size_t width, size_t block,
                   float* HWY_RESTRICT to) {
  const hn::CappedTag<float, 8> d;
  const auto quarter = hn::Set(d, 0.25f);
  for (size_t x = 0; x < width; ++x)
    for (size_t c = 0; c < block; c += hn::Lanes(d)) {
      const size_t left = 2 * x * block + c, right = left + block;
      const auto a = hn::Add(hn::LoadU(d, upper + left), hn::LoadU(d, upper + right));
      const auto b = hn::Add(hn::LoadU(d, lower + left), hn::LoadU(d, lower + right));
      hn::StoreU(hn::Mul(hn::Add(a, b), quarter), d, to + x * block + c);
    }
}

// One row of logits to rows of weights, `stride` floats apart. `shares`: three rows, or null. Writes whole vectors.
void WeightRow(const float* HWY_RESTRICT logits, size_t groupStride, int block, size_t width,
               float* HWY_RESTRICT weights, size_t stride, float* const* shares) {
  const D d;
  const size_t N = hn::Lanes(d), group = block == 8 ? 8 : 16, groups = 32 / group;
  const V most = hn::Set(d, 12.0f), least = hn::Set(d, -12.0f), one = hn::Set(d, 1.0f);
  HWY_ALIGN float planes[32 * hn::MaxLanes(d)];
  HWY_ALIGN float padded[16 * hn::MaxLanes(d)];
  for (size_t x = 0; x < width; x += N) {
    const size_t count = std::min(N, width - x);
    for (size_t g = 0; g < groups; ++g) {
      const float* from = logits + g * groupStride + x * group;
      if (count < N) {
        std::fill(std::copy_n(from, count * group, padded), padded + N * group, 0.0f);
        from = padded;
      }
      GroupToPlanes(d, from, int(group), planes + g * group * N);
    }
    for (size_t k = 0; k < kKernelTaps; ++k)
      hn::StoreU(hn::Exp(d, hn::Clamp(hn::Load(d, planes + k * N), least, most)), d, weights + k * stride + x);
    if (!shares) continue;
    const V a = hn::Load(d, planes + kKernelTaps * N), b = hn::Load(d, planes + (kKernelTaps + 1) * N),
            c = hn::Load(d, planes + (kKernelTaps + 2) * N), top = hn::Max(hn::Max(a, b), c), low = hn::Set(d, -80.0f);
    const V ea = hn::Exp(d, hn::Max(hn::Sub(a, top), low)), eb = hn::Exp(d, hn::Max(hn::Sub(b, top), low)),
            ec = hn::Exp(d, hn::Max(hn::Sub(c, top), low));
    const V scale = hn::Div(one, hn::Add(hn::Add(ea, eb), ec));
    hn::StoreU(hn::Mul(ea, scale), d, shares[0] + x);
    hn::StoreU(hn::Mul(eb, scale), d, shares[1] + x);
    hn::StoreU(hn::Mul(ec, scale), d, shares[2] + x);
  }
}

// One row of results. weights[i], values[i]: the weights' and the splatted rows of row y + 2 - i, which gives by tap row i.
template <size_t kPlanes>
HWY_INLINE void SplatPlanes(const float* const* weights, size_t stride, const float* const (*values)[kMostSplatted],
                            size_t width, float* const* to) {
  const D d;
  const V tiny = hn::Set(d, 1e-12f), one = hn::Set(d, 1.0f), zero = hn::Zero(d);
  for (size_t x = 0; x < width; x += hn::Lanes(d)) {
    V sum[kMostSplatted] = {zero, zero, zero, zero, zero, zero, zero, zero, zero, zero, zero, zero};
    for (size_t i = 0; i < kKernelWidth; ++i)
      for (size_t j = 0; j < kKernelWidth; ++j) {
        const ptrdiff_t from = ptrdiff_t(x) + kKernelWidth / 2 - ptrdiff_t(j);
        const V w = hn::LoadU(d, weights[i] + (i * kKernelWidth + j) * stride + from);
        for (size_t p = 0; p < kPlanes; ++p) sum[p] = hn::MulAdd(w, hn::LoadU(d, values[i][p] + from), sum[p]);
      }
    const V scale = hn::Div(one, hn::Add(sum[4], tiny));
    for (size_t c = 0; c < 3; ++c) hn::StoreU(hn::Mul(sum[c], scale), d, to[c] + x);
    hn::StoreU(hn::Min(hn::Mul(sum[3], scale), one), d, to[3] + x);
    for (size_t p = 5; p < kPlanes; ++p) hn::StoreU(hn::Mul(sum[p], scale), d, to[p - 1] + x);
  }
}

void SplatRow(const float* const* weights, size_t stride, const float* const (*values)[kMostSplatted], bool divided,
              size_t width, float* const* to) {
  if (divided)
    SplatPlanes<kMostSplatted>(weights, stride, values, width, to);
  else
    SplatPlanes<kSplatted>(weights, stride, values, width, to);
}

void ScaleRow(const float* HWY_RESTRICT factor, const float* HWY_RESTRICT from, size_t width, float* HWY_RESTRICT to) {
  const D d;
  for (size_t x = 0; x < width; x += hn::Lanes(d))
    hn::StoreU(hn::Mul(hn::LoadU(d, factor + x), hn::LoadU(d, from + x)), d, to + x);
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::nn
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fathom::nn {

HWY_EXPORT(AddGroup);
HWY_EXPORT(Shares);
HWY_EXPORT(HalveGroupRow);
HWY_EXPORT(WeightRow);
HWY_EXPORT(SplatRow);
HWY_EXPORT(ScaleRow);

namespace {

constexpr int kSlack = 64;  // more floats than any vector has

}  // namespace

void WidePlanes::resize(size_t count, int height, int width) {
  height_ = height;
  width_ = width;
  stride_ = (width + 2 * kBorder + kSlack + 15) / 16 * 16;
  const size_t needed = count * size_t(height) * size_t(stride_);
  if (values_.size() < needed) values_ = Buffer<float>(needed, 0.0f);
}

Planes WidePlanes::planes(size_t count) {
  Planes result{{}, stride_};
  for (size_t p = 0; p < count; ++p) result.plane.push_back(row(p, 0));
  return result;
}

ConstPlanes WidePlanes::planes(size_t count) const {
  ConstPlanes result{{}, stride_};
  for (size_t p = 0; p < count; ++p) result.plane.push_back(row(p, 0));
  return result;
}

void WidePlanes::clearBorders() {
  const size_t rows = values_.size() / size_t(std::max<ptrdiff_t>(stride_, 1));
  for (size_t r = 0; r < rows; ++r) {
    float* first = values_.data() + ptrdiff_t(r) * stride_;
    std::fill(first, first + kBorder, 0.0f);
    std::fill(first + kBorder + width_, first + stride_, 0.0f);
  }
}

void addWeighted(const float* values, size_t stride, int groups, int block, const float* weight, const uint32_t* pixel,
                 size_t count, float* sums, size_t sumStride) {
  const auto add = HWY_DYNAMIC_DISPATCH(AddGroup);
  for (size_t g = 0; g < size_t(groups); ++g)
    add(values + g * stride, size_t(block), weight, pixel, count, sums + g * sumStride);
}

void layerShares(const float* logits, int block, size_t count, int layers, float* shares, size_t stride) {
  for (size_t l = 0; l < size_t(layers); ++l) {
    float* to = shares + l * stride;
    for (size_t i = 0; i < count; ++i) to[i] = logits[i * size_t(block) + l];
    std::fill_n(to + count, std::min(size_t(kSlack), stride - count), 0.0f);
  }
  HWY_DYNAMIC_DISPATCH(Shares)(count, size_t(layers), shares, stride);
}

void halveGroups(const float* from, int groups, int height, int width, int block, float* to) {
  const auto halveRow = HWY_DYNAMIC_DISPATCH(HalveGroupRow);
  const size_t row = size_t(width) * size_t(block);
  for (size_t y = 0; y < size_t(groups) * size_t(height) / 2; ++y)
    halveRow(from + 2 * y * row, from + (2 * y + 1) * row, size_t(width / 2), size_t(block), to + y * row / 2);
}

void splat(const float* logits, int block, const WidePlanes& values, bool divided, WidePlanes& result,
           WidePlanes* shares) {
  const size_t splatted = divided ? kMostSplatted : kSplatted, planes = splatted - 1;
  constexpr int kRows = kKernelWidth, kReach = kKernelWidth / 2;
  const int height = values.height(), width = values.width();
  const size_t rowFloats = size_t(width) * size_t(block), groupStride = size_t(height) * rowFloats;
  const size_t stride = size_t(values.stride());
  // Weights of kRows rows around one: those of row y lie in place y modulo kRows. Those beyond the image stay 0.
  std::array<Buffer<float>, kRows> ring;
  for (Buffer<float>& weights : ring) weights = Buffer<float>(kKernelTaps * stride, 0.0f);
  const Buffer<float> none(kKernelTaps * stride, 0.0f);
  result.resize(planes, height, width);
  if (shares) shares->resize(kLayerScales, height, width);
  const auto weightRow = HWY_DYNAMIC_DISPATCH(WeightRow);
  const auto splatRow = HWY_DYNAMIC_DISPATCH(SplatRow);
  const auto inside = [&](int y) { return y >= 0 && y < height; };
  for (int made = 0; made < height + kReach; ++made) {
    if (inside(made)) {
      float* weights = ring[size_t(made % kRows)].data() + WidePlanes::kBorder;
      float* to[kLayerScales] = {};
      for (size_t i = 0; shares && i < kLayerScales; ++i) to[i] = shares->row(i, made);
      weightRow(logits + size_t(made) * rowFloats, groupStride, block, size_t(width), weights, stride,
                shares ? to : nullptr);
      for (size_t k = 0; k < kKernelTaps; ++k)
        std::fill(weights + k * stride + width, weights + (k + 1) * stride - WidePlanes::kBorder, 0.0f);
    }
    const int y = made - kReach;
    if (!inside(y)) continue;
    const float* weights[kRows];
    const float* rows[kRows][kMostSplatted] = {};
    for (int i = 0; i < kRows; ++i) {
      const int from = y + kReach - i;
      weights[i] = (inside(from) ? ring[size_t(from % kRows)] : none).data() + WidePlanes::kBorder;
      for (size_t p = 0; p < splatted; ++p) rows[i][p] = values.row(p, inside(from) ? from : y);
    }
    float* to[kMostSplatted] = {};
    for (size_t p = 0; p < planes; ++p) to[p] = result.row(p, y);
    splatRow(weights, stride, rows, divided, size_t(width), to);
  }
}

void scaleRows(const WidePlanes& factor, const WidePlanes& from, size_t count, WidePlanes& to) {
  to.resize(count, from.height(), from.width());
  const auto scaleRow = HWY_DYNAMIC_DISPATCH(ScaleRow);
  for (size_t p = 0; p < count; ++p)
    for (int y = 0; y < from.height(); ++y)
      scaleRow(factor.row(0, y), from.row(p, y), size_t(from.width()), to.row(p, y));
}

}  // namespace fathom::nn
#endif
