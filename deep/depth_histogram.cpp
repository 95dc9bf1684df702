#include "deep/depth_histogram.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "base/progress.h"
#include "deep/row_weights.h"
#include "deep/sample_depths.h"

namespace fathom::deep {

namespace {

constexpr int kRows = 16;  // of a tile, which has a histogram of its own
constexpr double kDecades = 1e9;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The smallest and largest depths; where there is none the first is the larger.
struct Extent {
  double first = kInfinity, last = -kInfinity;

  void put(double depth, bool logarithmic) {
    if (!std::isfinite(depth) || (logarithmic && depth <= 0)) return;
    first = std::min(first, depth);
    last = std::max(last, depth);
  }
  void put(const Extent& other) {
    first = std::min(first, other.first);
    last = std::max(last, other.last);
  }
};

// Adds weights to the bins of an axis.
class Spreader {
 public:
  Spreader(const DepthAxis& axis, int bins) : axis_(axis), edges_(size_t(bins) + 1), bins_(size_t(bins), 0.0) {
    for (int i = 0; i <= bins; ++i) edges_[size_t(i)] = axis.depth(double(i) / bins);
    edges_.back() = axis.far;
  }

  void put(const Range& range, double weight) {
    const double begin = std::max(double(range.z), axis_.near), end = std::min(double(range.zBack), axis_.far);
    if (range.isPoint()) {
      if (begin == end) bins_[binOf(begin)] += weight;
      return;
    }
    if (!(begin < end)) return;
    const double density = weight / (double(range.zBack) - double(range.z));
    const size_t first = binOf(begin), last = binOf(end);
    for (size_t i = first; i <= last; ++i)
      bins_[i] += density * (std::min(end, edges_[i + 1]) - std::max(begin, edges_[i]));
  }

  std::vector<double> take() { return std::move(bins_); }

 private:
  // Of a depth on the axis, whichever way its place was rounded.
  size_t binOf(double depth) const {
    const size_t last = bins_.size() - 1;
    size_t bin = std::min(size_t(axis_.place(depth) * double(bins_.size())), last);
    while (bin > 0 && depth < edges_[bin]) --bin;
    while (bin < last && depth >= edges_[bin + 1]) ++bin;
    return bin;
  }

  DepthAxis axis_;
  std::vector<double> edges_, bins_;
};

}  // namespace

DepthAxis axisOf(const DeepImage& image, bool logarithmic) {
  const SampleDepths depths(image);
  const int height = image.dataWindow.height();
  std::vector<Extent> tiles(size_t(height / kRows + 1));
  parallelRanges(0, height, kRows, [&](int y0, int y1) {
    const size_t width = size_t(image.dataWindow.width());
    Extent extent;
    for (size_t i = image.offsets[size_t(y0) * width]; i < image.offsets[size_t(y1) * width]; ++i) {
      extent.put(double(depths[i].z), logarithmic);
      extent.put(double(depths[i].zBack), logarithmic);
    }
    tiles[size_t(y0 / kRows)] = extent;
  });
  Extent all;
  for (const Extent& tile : tiles) all.put(tile);
  return axisAround(logarithmic ? std::max(all.first, all.last / kDecades) : all.first, all.last, logarithmic);
}

std::vector<double> depthHistogram(const DeepImage& image, const DepthAxis& axis, int bins, DepthWeight weight,
                                   const std::stop_token& stop) {
  const SampleDepths depths(image);
  if (weight == DepthWeight::Seen) (void)RowCompositor(image);  // throws for images without rows, too
  const int height = image.dataWindow.height();
  const size_t width = size_t(image.dataWindow.width());
  std::vector<std::vector<double>> tiles(size_t(height / kRows + 1));
  const auto fill = [&](int y0, int y1) {
    Spreader spreader(axis, bins);
    for (size_t i = image.offsets[size_t(y0) * width]; i < image.offsets[size_t(y1) * width]; ++i)
      spreader.put(depths[i], 1);
    return spreader.take();
  };
  const auto fillSeen = [&](int y0, int y1) {
    Spreader spreader(axis, bins);
    RowCompositor compositor(image);
    for (size_t pixel = size_t(y0) * width; pixel < size_t(y1) * width; pixel += width) {
      const std::vector<double>& seen = compositor.composite(pixel, pixel + width).seen;
      const size_t first = image.offsets[pixel];
      for (size_t i = 0; i < seen.size(); ++i)
        if (seen[i] > 0) spreader.put(depths[first + i], seen[i]);
    }
    return spreader.take();
  };
  parallelRanges(0, height, kRows, [&](int y0, int y1) {
    if (stop.stop_requested()) throw Cancelled();
    tiles[size_t(y0 / kRows)] = weight == DepthWeight::Seen ? fillSeen(y0, y1) : fill(y0, y1);
  });
  std::vector<double> total(size_t(bins), 0.0);
  for (const std::vector<double>& tile : tiles)
    for (size_t i = 0; i < tile.size(); ++i) total[i] += tile[i];
  return total;
}

}  // namespace fathom::deep
