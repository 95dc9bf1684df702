#include "deep/box_statistics.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "deep/row_weights.h"
#include "deep/sample_depths.h"
#include "flat/finite.h"

namespace fathom::deep {

namespace {

constexpr std::array<double, 3> kLuminance{0.2126, 0.7152, 0.0722};  // Rec. 709

// Sums; `depth` is weighted by `depthAlpha`.
struct Bin {
  BinStatistics sum;
  double depthAlpha = 0;

  void add(const Bin& other) {
    sum.pixels += other.sum.pixels;
    sum.depth += other.sum.depth;
    sum.alpha += other.sum.alpha;
    sum.energy += other.sum.energy;
    depthAlpha += other.depthAlpha;
  }
};

struct Row {
  std::vector<Bin> bins;
  double alpha = 0;
  std::array<double, 3> colour = {};
};

class RowSums {
 public:
  RowSums(const DeepImage& image, const std::array<std::string, 3>& colour)
      : image_(image), depths_(image), colour_{image.get(colour[0]), image.get(colour[1]), image.get(colour[2])} {}

  Row of(size_t begin, size_t end) const {
    RowCompositor compositor(image_);
    const RowWeights& weights = compositor.composite(begin, end);
    const size_t firstSample = image_.offsets[begin];
    Row row;
    for (size_t pixel = begin; pixel < end; ++pixel) {
      row.alpha += weights.alpha[pixel - begin];
      row.bins.resize(std::max(row.bins.size(), image_.count(pixel)));
      for (size_t i = image_.offsets[pixel]; i < image_.offsets[pixel + 1]; ++i)
        add(i, weights.seen[i - firstSample], weights.premultiplied[i - firstSample],
            row.bins[i - image_.offsets[pixel]], row.colour);
    }
    return row;
  }

 private:
  void add(size_t sample, double seen, double weight, Bin& bin, std::array<double, 3>& sum) const {
    const Range range = depths_[sample];
    ++bin.sum.pixels;
    bin.sum.alpha += seen;
    if (std::isfinite(range.z)) {
      bin.sum.depth += seen * range.middle();
      bin.depthAlpha += seen;
    }
    for (size_t c = 0; c < 3; ++c) {
      const double value = weight * double(finiteOrZero(colour_[c][sample]));
      sum[c] += value;
      bin.sum.energy += kLuminance[c] * value;
    }
  }

  const DeepImage& image_;
  SampleDepths depths_;
  std::array<std::span<const float>, 3> colour_;
};

}  // namespace

BoxStatistics boxStatistics(const DeepImage& image, const Box& box, const std::array<std::string, 3>& colour) {
  const RowSums sums(image, colour);
  BoxStatistics result;
  result.box = intersect(box, image.dataWindow);
  if (result.box.empty()) return result;
  result.counts.add(image, result.box);
  std::vector<Row> rows(size_t(result.box.height()));
  parallelFor(result.box.y0, result.box.y1, [&](int y) {
    const size_t first = image.dataWindow.index(result.box.x0, y);
    rows[size_t(y - result.box.y0)] = sums.of(first, first + size_t(result.box.width()));
  });
  std::vector<Bin> bins;
  const double each = 1 / double(result.box.area());
  for (const Row& row : rows) {
    bins.resize(std::max(bins.size(), row.bins.size()));
    for (size_t i = 0; i < row.bins.size(); ++i) bins[i].add(row.bins[i]);
    result.alpha += row.alpha * each;
    for (size_t c = 0; c < 3; ++c) result.colour[c] += row.colour[c] * each;
  }
  for (const Bin& bin : bins)
    result.bins.push_back({bin.sum.pixels, bin.depthAlpha > 0 ? bin.sum.depth / bin.depthAlpha : 0,
                           bin.sum.alpha * each, bin.sum.energy * each});
  return result;
}

}  // namespace fathom::deep
