#include "deep/sample_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "deep/sample_depths.h"

namespace fathom::deep {

namespace {

bool isBefore(const Range& a, const Range& b) {
  return a.z < b.z || (a.z == b.z && a.zBack < b.zBack);
}

// What is left of a sample's alpha.
double remaining(const RangeCut& cut, const Range& sample, double alpha) {
  if (cut.leavesWhole(sample)) return alpha;
  if (cut.leavesNothing(sample)) return 0;
  std::array<Fragment, 2> parts;
  double passing = 1;
  for (const Fragment& part : cut.cut(sample, alpha, parts)) passing *= 1 - part.alpha;
  return 1 - passing;
}

// at(result index, pixel of the image) for the pixels of the data window that are looked at, rows in parallel.
template <class At>
void forPixels(const DeepImage& image, const Box& box, int step, const At& at) {
  const int width = (box.width() + step - 1) / step, height = (box.height() + step - 1) / step;
  parallelFor(0, height, [&](int row) {
    for (int column = 0; column < width; ++column) {
      const int x = box.x0 + column * step, y = box.y0 + row * step;
      if (image.dataWindow.contains(x, y))
        at(size_t(row) * size_t(width) + size_t(column), image.dataWindow.index(x, y));
    }
  });
}

size_t pixelsOf(const Box& box, int step) {
  return size_t((box.width() + step - 1) / step) * size_t((box.height() + step - 1) / step);
}

// The sample that is seen most, of those in `order`, front to back.
uint64_t mostSeenOf(const std::vector<size_t>& order, const SampleDepths& depths, std::span<const float> alpha,
                    const RangeCut& cut) {
  uint64_t best = kNoSample;
  double most = 0, passing = 1;
  for (const size_t i : order) {
    if (passing <= most) break;  // nothing behind is seen more
    const double left = remaining(cut, depths[i], opacity(alpha[i]));
    if (left * passing > most) most = left * passing, best = i;
    passing *= 1 - left;
  }
  return best;
}

}  // namespace

Buffer<uint64_t> mostSeen(const DeepImage& image, const Box& box, int step, const DepthRange& range) {
  const SampleDepths depths(image);
  const auto alpha = image.get("A");
  const RangeCut cut(range);
  Buffer<uint64_t> result(pixelsOf(box, step), kNoSample);
  forPixels(image, box, step, [&](size_t to, size_t pixel) {
    thread_local std::vector<size_t> order;
    order.resize(image.count(pixel));
    std::iota(order.begin(), order.end(), size_t(image.offsets[pixel]));
    const auto before = [&](size_t i, size_t j) { return isBefore(depths[i], depths[j]); };
    if (!std::ranges::is_sorted(order, before)) std::ranges::stable_sort(order, before);
    result[to] = mostSeenOf(order, depths, alpha, cut);
  });
  return result;
}

Buffer<uint32_t> countSamples(const DeepImage& image, const Box& box, int step, const DepthRange& range) {
  Buffer<uint32_t> result(pixelsOf(box, step), 0);
  if (range.isAll()) {
    forPixels(image, box, step, [&](size_t to, size_t pixel) { result[to] = uint32_t(image.count(pixel)); });
    return result;
  }
  const SampleDepths depths(image);
  const RangeCut cut(range);
  forPixels(image, box, step, [&](size_t to, size_t pixel) {
    for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i)
      if (cut.leavesAnything(depths[i])) ++result[to];
  });
  return result;
}

Buffer<uint8_t> findNonFinite(const DeepImage& image, const Box& box, int step, const DepthRange& range,
                              const std::vector<std::string>& channels) {
  const SampleDepths depths(image);
  const RangeCut cut(range);
  std::vector<std::span<const float>> planes;
  for (const std::string& channel : channels) planes.push_back(image.get(channel));
  const auto isSpoiled = [&](size_t i) {
    return std::ranges::any_of(planes, [&](const auto& plane) { return !isFinite(plane[i]); });
  };
  Buffer<uint8_t> result(pixelsOf(box, step), 0);
  forPixels(image, box, step, [&](size_t to, size_t pixel) {
    for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i)
      if (isSpoiled(i) && cut.leavesAnything(depths[i])) result[to] = 1;
  });
  return result;
}

std::optional<float> nearestDepth(const DeepImage& image, int x, int y) {
  const auto z = image.get("Z"), alpha = image.get("A");
  if (!image.dataWindow.contains(x, y)) return {};
  const size_t pixel = image.dataWindow.index(x, y);
  std::optional<float> nearest;
  for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i)
    if (alpha[i] > 0 && std::isfinite(z[i]) && (!nearest || z[i] < *nearest)) nearest = z[i];
  return nearest;
}

}  // namespace fathom::deep
