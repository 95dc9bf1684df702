#include "deep/match.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "deep/bin_layout.h"
#include "flat/parallel.h"

namespace fathom::deep {

namespace {

struct Bin {
  double depth;
  size_t sample;
  bool operator<(const Bin& other) const {
    return depth < other.depth || (depth == other.depth && sample < other.sample);
  }
};

std::vector<Bin> binsOf(const DeepImage& image, std::span<const float> z, std::span<const float> zBack, size_t pixel) {
  std::vector<Bin> bins;
  for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i)
    bins.push_back({double(zBack.empty() ? binDepth(z[i], z[i]) : binDepth(z[i], zBack[i])), i});
  std::sort(bins.begin(), bins.end());
  return bins;
}

// The first of those at the nearest depth; there is at least one.
size_t nearest(const std::vector<Bin>& bins, double depth) {
  const auto first = [&](double at) { return std::lower_bound(bins.begin(), bins.end(), Bin{at, 0}) - bins.begin(); };
  const auto above = first(depth), below = above > 0 ? first(bins[size_t(above) - 1].depth) : above;
  const bool takeBelow = size_t(above) == bins.size() ||
                         (above > 0 && depth - bins[size_t(below)].depth <= bins[size_t(above)].depth - depth);
  return size_t(takeBelow ? below : above);
}

// Matches those that are nearest to each other and takes them out; whether there were any.
bool matchNearest(std::vector<Bin>& from, std::vector<Bin>& to, double tolerance, Buffer<int64_t>& result) {
  if (from.empty() || to.empty()) return false;
  std::vector<Bin> fromLeft, toLeft;
  std::vector<bool> taken(from.size(), false);
  for (size_t i = 0; i < to.size(); ++i) {
    const size_t k = nearest(from, to[i].depth);
    const bool near = std::abs(from[k].depth - to[i].depth) <= tolerance * std::abs(to[i].depth);
    if (near && nearest(to, from[k].depth) == i) {
      result[to[i].sample] = int64_t(from[k].sample);
      taken[k] = true;
    } else {
      toLeft.push_back(to[i]);
    }
  }
  for (size_t k = 0; k < from.size(); ++k)
    if (!taken[k]) fromLeft.push_back(from[k]);
  const bool matched = toLeft.size() < to.size();
  from = std::move(fromLeft);
  to = std::move(toLeft);
  return matched;
}

}  // namespace

Buffer<int64_t> matchBins(const DeepImage& from, const DeepImage& to, const MatchParams& params) {
  const std::span<const float> fromZ = from.get("Z"), fromBack = from.tryGet("ZBack");
  const std::span<const float> toZ = to.get("Z"), toBack = to.tryGet("ZBack");
  Buffer<int64_t> result(to.samples(), -1);
  const Box both = intersect(from.dataWindow, to.dataWindow);
  parallelFor(both.y0, both.y1, [&](int y) {
    for (int x = both.x0; x < both.x1; ++x) {
      std::vector<Bin> fromBins = binsOf(from, fromZ, fromBack, from.dataWindow.index(x, y));
      std::vector<Bin> toBins = binsOf(to, toZ, toBack, to.dataWindow.index(x, y));
      while (matchNearest(fromBins, toBins, params.tolerance, result)) continue;
    }
  });
  return result;
}

}  // namespace fathom::deep
