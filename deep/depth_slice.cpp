#include "deep/depth_slice.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "deep/channels.h"
#include "deep/piece_depth.h"
#include "deep/pixel_pieces.h"
#include "deep/sample_depths.h"
#include "flat/finite.h"

namespace fathom::deep {

namespace {

constexpr int kColumns = 32;  // that one task takes

struct Sources {
  std::span<const float> alpha;
  SampleDepths depths;
  std::vector<const float*> channels;
  bool mergePoints;
};

Sources sourcesOf(const DeepImage& image, const std::vector<std::string>& channels) {
  Sources result{image.get("A"), SampleDepths(image), {}, !holdsStatistics(image)};
  for (const std::string& name : channels) result.channels.push_back(image.get(name).data());
  return result;
}

// One column after the other; A is the last of the values.
class Column {
 public:
  Column(const Sources& sources, const std::vector<float>& planes)
      : from_(sources), planes_(planes), values_(planes.size() - 1, std::vector<double>(sources.channels.size() + 1)) {}

  void rasterise(const DeepImage& image, size_t pixel) {
    for (std::vector<double>& cell : values_) std::ranges::fill(cell, 0);
    const size_t first = size_t(image.offsets[pixel]), count = image.count(pixel);
    pieces_.set(from_.depths.fronts(first, count), from_.depths.backs(first, count));
    pieces_.checkOverlaps(from_.mergePoints, image.dataWindow, pixel);
    pieces_.visit(from_.alpha.subspan(first, count), from_.mergePoints, [&](const Piece& piece) { put(piece, first); });
  }
  double value(size_t cell, size_t channel) const { return values_[cell][channel]; }

 private:
  void put(const Piece& piece, size_t first) {
    if (!std::isfinite(piece.range.z)) return;
    colour_.assign(from_.channels.size(), 0);
    for (const Share& share : piece.shares)
      for (size_t c = 0; c < colour_.size(); ++c)
        colour_[c] += share.weight * double(finiteOrZero(from_.channels[c][first + share.sample]));
    const auto behind = std::ranges::upper_bound(planes_, piece.range.z);  // the first plane behind the piece's front
    size_t cell = behind == planes_.begin() ? 0 : size_t(behind - planes_.begin()) - 1;
    if (piece.range.isPoint()) {
      if (behind != planes_.begin() && behind != planes_.end()) over(cell, {piece.alpha, 1});
      return;
    }
    const size_t count = pieces_.order().size();
    const double depth = opticalDepthOf(piece, from_.alpha.subspan(first, count), from_.depths.fronts(first, count),
                                        from_.depths.backs(first, count));
    // What is not opaque is cut as a volume, even where its alpha rounds to 1.
    const double alpha = std::isinf(depth) ? 1 : std::min(piece.alpha, 1 - 0x1p-53);
    const double length = double(piece.range.zBack) - double(piece.range.z);
    for (; cell < values_.size() && planes_[cell] < piece.range.zBack; ++cell) {
      const double inside =
          double(std::min(piece.range.zBack, planes_[cell + 1])) - double(std::max(piece.range.z, planes_[cell]));
      if (inside > 0) over(cell, partOf({alpha, depth, inside / length}));
    }
  }

  // What comes later lies behind.
  void over(size_t cell, const Part& part) {
    std::vector<double>& values = values_[cell];
    const double passed = 1 - values.back();
    for (size_t c = 0; c < colour_.size(); ++c) values[c] += passed * part.weight * colour_[c];
    values.back() += passed * part.alpha;
  }

  const Sources& from_;
  const std::vector<float>& planes_;
  std::vector<std::vector<double>> values_;  // per cell
  std::vector<double> colour_;               // of the whole piece
  PixelPieces pieces_;
};

}  // namespace

flat::Image depthSlice(const DeepImage& image, int y, int x0, int x1, const DepthAxis& axis, int cells,
                       const std::vector<std::string>& channels) {
  const Sources sources = sourcesOf(image, channels);
  const std::vector<float> planes = cellPlanes(axis, cells);
  flat::Image result;
  result.dataWindow = result.displayWindow = {x0, 0, x1, cells};
  std::vector<float*> to;
  for (const std::string& name : channels) to.push_back(result.add(name).values.data());
  to.push_back(result.add("A").values.data());
  parallelRanges(x0, x1, kColumns, [&](int first, int last) {
    Column column(sources, planes);
    for (int x = first; x < last; ++x) {
      if (!image.dataWindow.contains(x, y)) continue;
      column.rasterise(image, image.dataWindow.index(x, y));
      for (int cell = 0; cell < cells; ++cell)
        for (size_t c = 0; c < to.size(); ++c)
          to[c][result.dataWindow.index(x, cell)] = float(column.value(size_t(cell), c));
    }
  });
  return result;
}

DepthExtent depthExtent(const DeepImage& image, int y) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  DepthExtent extent{kInfinity, -kInfinity};
  const SampleDepths depths(image);
  const Box& window = image.dataWindow;
  if (y < window.y0 || y >= window.y1) return extent;
  const size_t first = window.index(window.x0, y);
  for (size_t i = image.offsets[first]; i < image.offsets[first + size_t(window.width())]; ++i) {
    const Range range = depths[i];
    if (!std::isfinite(range.z)) continue;
    extent.nearest = std::min(extent.nearest, range.z);
    extent.farthest = std::max(extent.farthest, range.zBack);
  }
  return extent;
}

}  // namespace fathom::deep
