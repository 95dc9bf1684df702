#include "deep/pixel_pieces.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"

namespace fathom::deep {

namespace {

constexpr size_t kMostShares = 100'000'000;  // of a pixel: more than is worth the time and the memory

// Of samples in order.
Untidiness overlapsOf(std::span<const Range> ranges, std::span<const size_t> order) {
  Untidiness result;
  const Range* before = nullptr;
  float end = -std::numeric_limits<float>::infinity();  // of the volumes so far
  for (const size_t sample : order) {
    const Range& range = ranges[sample];
    if (range.isPoint() && before && *before == range) result.pointsCoincide = true;
    if (range.z < end) result.volumesOverlap = true;
    if (!range.isPoint()) end = std::max(end, range.zBack);
    before = &range;
  }
  return result;
}

}  // namespace

Untidiness& Untidiness::operator|=(const Untidiness& other) {
  unsorted |= other.unsorted;
  pointsCoincide |= other.pointsCoincide;
  volumesOverlap |= other.volumesOverlap;
  return *this;
}

void PixelPieces::set(std::span<const float> z, std::span<const float> zBack) {
  ranges_.resize(z.size());
  order_.resize(z.size());
  const auto front = [](const Range& a, const Range& b) { return a.z < b.z || (a.z == b.z && a.zBack < b.zBack); };
  bool repaired = false, sorted = true;
  for (size_t i = 0; i < z.size(); ++i) {
    const Range given{z[i], zBack.empty() ? z[i] : zBack[i]};
    ranges_[i] = usableRange(given.z, given.zBack);
    order_[i] = i;
    repaired |= !(ranges_[i] == given);
    if (i > 0 && front(ranges_[i], ranges_[i - 1])) sorted = false;
  }
  if (!sorted)
    std::sort(order_.begin(), order_.end(),
              [&](size_t a, size_t b) { return front(ranges_[a], ranges_[b]) || (ranges_[a] == ranges_[b] && a < b); });
  untidiness_ = overlapsOf(ranges_, order_);
  untidiness_.unsorted = !sorted || repaired;
}

void PixelPieces::findCuts() {
  cuts_.clear();
  for (const Range& range : ranges_) {
    cuts_.push_back(range.z);
    if (!range.isPoint()) cuts_.push_back(range.zBack);
  }
  std::sort(cuts_.begin(), cuts_.end());
  cuts_.erase(std::unique(cuts_.begin(), cuts_.end()), cuts_.end());
}

PixelPieces::Size PixelPieces::size(bool mergePoints) {
  if (!untidiness_.any()) return {order_.size(), order_.size()};
  findCuts();
  const auto cut = [&](float z) { return size_t(std::lower_bound(cuts_.begin(), cuts_.end(), z) - cuts_.begin()); };
  Size size;
  size_t covered = 0;  // intervals before this cut have been counted
  const Range* before = nullptr;
  for (const size_t sample : order_) {
    const Range& range = ranges_[sample];
    if (range.isPoint()) {
      ++size.shares;
      if (!mergePoints || !before || !(*before == range)) ++size.pieces;
    } else {
      const size_t first = cut(range.z), last = cut(range.zBack);
      size.shares += last - first;
      size.pieces += last - std::clamp(covered, first, last);
      covered = std::max(covered, last);
    }
    before = &range;
  }
  return size;
}

double PixelPieces::opticalDepthOf(size_t sample) {
  if (depths_.empty()) depths_.assign(order_.size(), std::numeric_limits<double>::quiet_NaN());
  double& depth = depths_[sample];
  if (std::isnan(depth)) depth = opticalDepth(opacity(alpha_[sample]));
  return depth;
}

Piece PixelPieces::alone(size_t sample) {
  alone_ = {sample, 1, 1};
  return {ranges_[sample], opacity(alpha_[sample]), sample, true, {&alone_, 1}};
}

Piece PixelPieces::meet(std::span<const size_t> samples, Range range) {
  if (samples.size() == 1 && ranges_[samples[0]] == range) return alone(samples[0]);
  const double length = double(range.zBack) - double(range.z);
  slices_.clear();
  for (const size_t sample : samples) {
    const Range& whole = ranges_[sample];
    const double fraction = whole == range ? 1 : length / (double(whole.zBack) - double(whole.z));
    slices_.push_back({opacity(alpha_[sample]), opticalDepthOf(sample), fraction});
  }
  if (samples.size() == 1) {
    const Part part = partOf(slices_[0]);
    alone_ = {samples[0], part.weight, 1};
    return {range, part.alpha, samples[0], false, {&alone_, 1}};
  }
  weights_.resize(samples.size());
  parts_.resize(samples.size());
  shares_.resize(samples.size());
  const Merged merged = merge(slices_, weights_, parts_);
  for (size_t i = 0; i < samples.size(); ++i) shares_[i] = {samples[i], weights_[i], parts_[i]};
  return {range, merged.alpha, samples[merged.largest], false, shares_};
}

void checkOverlaps(PixelPieces::Size size, const Box& dataWindow, size_t pixel) {
  const size_t width = size_t(dataWindow.width());
  if (size.shares > kMostShares)
    fail("pixel ({}, {}): expected overlapping volumes that make at most {} pieces, found {}",
         dataWindow.x0 + int(pixel % width), dataWindow.y0 + int(pixel / width), kMostShares, size.shares);
}

void PixelPieces::checkOverlaps(bool mergePoints, const Box& dataWindow, size_t pixel) {
  const size_t samples = order_.size();  // each has a share in less than two pieces a sample
  if (2 * samples * samples > kMostShares) deep::checkOverlaps(size(mergePoints), dataWindow, pixel);
}

}  // namespace fathom::deep
