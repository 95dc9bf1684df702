#include "nn/blocked.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/blocked.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "nn/transpose-inl.h"

HWY_BEFORE_NAMESPACE();
namespace fathom::nn {
namespace HWY_NAMESPACE {

// One row of one group; `planes` are the rows of at most `block` planes.
void PackRow(const float* const* planes, size_t count, size_t width, int block, float* HWY_RESTRICT to) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::ScalableTag<float> d;
  const size_t N = hn::Lanes(d), group = size_t(block);
  HWY_ALIGN float lanes[16 * hn::MaxLanes(d)];
  std::fill(lanes + count * N, lanes + group * N, 0.0f);
  size_t x = 0;
  for (; x + N <= width; x += N) {
    for (size_t c = 0; c < count; ++c) hn::Store(hn::LoadU(d, planes[c] + x), d, lanes + c * N);
    PlanesToGroup(d, lanes, block, to + x * group);
  }
  for (; x < width; ++x)
    for (size_t c = 0; c < group; ++c) to[x * group + c] = c < count ? planes[c][x] : 0.0f;
}

}  // namespace HWY_NAMESPACE
}  // namespace fathom::nn
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fathom::nn {

namespace {

HWY_EXPORT(PackRow);

template <size_t kBytes>
void enlargeRow(const std::byte* from, size_t width, std::byte* to) {
  for (size_t x = 0; x < width; ++x) {
    std::memcpy(to + 2 * x * kBytes, from + x * kBytes, kBytes);
    std::memcpy(to + (2 * x + 1) * kBytes, from + x * kBytes, kBytes);
  }
}

}  // namespace

void toBfloat16(const float* from, size_t count, uint16_t* to) {
  for (size_t i = 0; i < count; ++i) {
    const uint32_t bits = std::bit_cast<uint32_t>(from[i]);
    to[i] = uint16_t((bits + 0x7fff + (bits >> 16 & 1)) >> 16);
  }
}

void toElements(const float* from, size_t count, Element element, std::byte* to) {
  if (element == Element::float32)
    std::memcpy(to, from, count * sizeof(float));
  else
    toBfloat16(from, count, reinterpret_cast<uint16_t*>(to));
}

void toFloats(const std::byte* from, size_t count, Element element, float* to) {
  if (element == Element::float32) {
    std::memcpy(to, from, count * sizeof(float));
    return;
  }
  const auto* halves = reinterpret_cast<const uint16_t*>(from);
  for (size_t i = 0; i < count; ++i) to[i] = std::bit_cast<float>(uint32_t(halves[i]) << 16);
}

void packPlanes(const ConstPlanes& from, int height, int width, int block, Element element, std::byte* to) {
  const size_t rowValues = size_t(width) * size_t(block), rowBytes = rowValues * bytesOf(element);
  std::vector<float> floats(element == Element::float32 ? 0 : rowValues);
  const auto pack = HWY_DYNAMIC_DISPATCH(PackRow);
  for (size_t first = 0; first < from.plane.size(); first += size_t(block)) {
    const size_t count = std::min(size_t(block), from.plane.size() - first);
    std::vector<const float*> rows(from.plane.begin() + ptrdiff_t(first),
                                   from.plane.begin() + ptrdiff_t(first + count));
    for (int y = 0; y < height; ++y, to += rowBytes) {
      float* row = element == Element::float32 ? reinterpret_cast<float*>(to) : floats.data();
      pack(rows.data(), count, size_t(width), block, row);
      if (element == Element::bfloat16) toBfloat16(row, rowValues, reinterpret_cast<uint16_t*>(to));
      for (const float*& r : rows) r += from.stride;
    }
  }
}

void cropGroups(const std::byte* from, size_t groups, int height, int width, size_t pixelBytes, const Window& window,
                std::byte* to) {
  const size_t rowBytes = size_t(window.width) * pixelBytes;
  for (size_t g = 0; g < groups; ++g)
    for (int y = 0; y < window.height; ++y, to += rowBytes)
      std::memcpy(to,
                  from + ((g * size_t(height) + size_t(window.y + y)) * size_t(width) + size_t(window.x)) * pixelBytes,
                  rowBytes);
}

void pasteGroups(const std::byte* from, size_t groups, int height, int width, size_t pixelBytes, const Window& window,
                 std::byte* to, int toHeight, int toWidth, int x, int y) {
  const auto at = [&](size_t g, int rows, int columns, int row, int column) {
    return ((g * size_t(rows) + size_t(row)) * size_t(columns) + size_t(column)) * pixelBytes;
  };
  for (size_t g = 0; g < groups; ++g)
    for (int i = 0; i < window.height; ++i)
      std::memcpy(to + at(g, toHeight, toWidth, y + i, x), from + at(g, height, width, window.y + i, window.x),
                  size_t(window.width) * pixelBytes);
}

void enlargeGroups(const std::byte* from, size_t groups, int height, int width, size_t pixelBytes, std::byte* to) {
  const auto enlarge = pixelBytes == 64 ? enlargeRow<64> : pixelBytes == 32 ? enlargeRow<32> : enlargeRow<16>;
  const size_t rowBytes = size_t(width) * pixelBytes;
  for (size_t row = 0; row < groups * size_t(height); ++row, from += rowBytes, to += 4 * rowBytes) {
    enlarge(from, size_t(width), to);
    std::memcpy(to + 2 * rowBytes, to, 2 * rowBytes);
  }
}

}  // namespace fathom::nn
#endif
