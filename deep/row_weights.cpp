#include "deep/row_weights.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "deep/channels.h"
#include "deep/piece_depth.h"

namespace fathom::deep {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

}  // namespace

// What compositing pieces front to back adds up.
struct RowCompositor::Pixel {
  double passed = 1;  // transmittance so far
  double alpha = 0;
  double depth = 0, depthAlpha = 0;  // of the pieces at a finite depth
  float nearest = kInfinity;

  // Returns the transmittance in front of the piece.
  double put(const Range& range, double pieceAlpha) {
    const double front = passed, seen = front * pieceAlpha;
    const bool finite = std::isfinite(range.z);
    nearest = std::min(nearest, range.z);
    alpha += seen;
    depth += finite ? seen * range.middle() : 0;
    depthAlpha += finite ? seen : 0;
    passed *= 1 - pieceAlpha;
    return front;
  }
};

// Where what is seen begins, ends, and passes the wanted transmittance.
struct RowCompositor::Ends {
  float front = kInfinity, back = kInfinity, passing = kInfinity;

  // `depth`: optical.
  void put(const Range& range, double pieceAlpha, double depth, double passedBefore, double passes) {
    if (!(passedBefore * pieceAlpha > 0) || !std::isfinite(range.z)) return;
    front = std::min(front, range.z);
    back = std::isinf(depth) ? range.z : range.zBack;
    const double passed = passedBefore * (1 - pieceAlpha);
    if (passedBefore > passes && passed <= passes) passing = depthPassing(range, depth, passes / passedBefore);
  }

 private:
  // Transmittance inside of a volume falls as (1 - alpha)^x, x from 0 to 1.
  static float depthPassing(const Range& range, double depth, double passes) {
    if (range.isPoint() || std::isinf(depth)) return range.z;
    const double x = -std::log(passes) / depth;
    return std::min(float(range.z + x * (double(range.zBack) - double(range.z))), range.zBack);
  }
};

RowCompositor::RowCompositor(const DeepImage& image, bool findEnds, double passes)
    : image_(image),
      alpha_(image.get("A")),
      depths_(image),
      mergePoints_(!holdsStatistics(image)),
      findEnds_(findEnds),
      passes_(passes) {}

// The usual pixel, whose samples go from front to back and do not meet. False where they do: then the pixel is to be
// done again.
bool RowCompositor::compositeTidy(size_t begin, size_t end, Pixel& result) {
  const float *const z = depths_.z.data(), *const zBack = depths_.zBack.data(), *const alphas = alpha_.data();
  double *const premultiplied = row_.premultiplied.data(), *const seen = row_.seen.data();
  const size_t rowBegin = rowBegin_;
  const bool mergePoints = mergePoints_;
  Pixel sum;                                       // stays in registers
  float before = -kInfinity, behind = -kInfinity;  // where the last sample began and ended
  for (size_t i = begin; i < end; ++i) {
    const Range range = usableRange(z[i], zBack[i]);
    if (range.z < behind) return false;
    if (range.z == before && mergePoints && range.isPoint() && i > begin) return false;
    before = range.z;
    behind = range.zBack;
    const double alpha = opacity(alphas[i]), front = sum.put(range, alpha);
    premultiplied[i - rowBegin] = front;
    seen[i - rowBegin] = front * alpha;
  }
  result = sum;
  return true;
}

void RowCompositor::compositeAny(size_t pixel, size_t begin, size_t end, Pixel& sum, Ends& ends) {
  const size_t count = end - begin, first = begin - rowBegin_;
  std::fill_n(row_.premultiplied.begin() + ptrdiff_t(first), count, 0.0);
  std::fill_n(row_.seen.begin() + ptrdiff_t(first), count, 0.0);
  pieces_.set(depths_.fronts(begin, count), depths_.backs(begin, count));
  pieces_.checkOverlaps(mergePoints_, image_.dataWindow, pixel);
  pieces_.visit(alpha_.subspan(begin, count), mergePoints_, [&](const Piece& piece) {
    const double front = sum.put(piece.range, piece.alpha);
    if (findEnds_) {
      const double depth = opticalDepthOf(piece, alpha_.subspan(begin, count), depths_.fronts(begin, count),
                                          depths_.backs(begin, count));
      ends.put(piece.range, piece.alpha, depth, front, passes_);
    }
    for (const Share& share : piece.shares) {
      row_.premultiplied[first + share.sample] += front * share.weight;
      row_.seen[first + share.sample] += front * piece.alpha * share.part;
    }
  });
}

// The ends of a pixel that compositeTidy has composited.
void RowCompositor::findEnds(size_t begin, size_t end, Ends& ends) const {
  for (size_t i = begin; i < end; ++i) {
    const double alpha = opacity(alpha_[i]);
    ends.put(depths_[i], alpha, opticalDepth(alpha), row_.premultiplied[i - rowBegin_], passes_);
  }
}

const RowWeights& RowCompositor::composite(size_t firstPixel, size_t endPixel) {
  rowBegin_ = image_.offsets[firstPixel];
  row_.premultiplied.resize(image_.offsets[endPixel] - rowBegin_);
  row_.seen.resize(row_.premultiplied.size());
  row_.alpha.resize(endPixel - firstPixel);
  row_.depths.resize(endPixel - firstPixel);
  for (size_t pixel = firstPixel; pixel < endPixel; ++pixel) {
    const size_t begin = image_.offsets[pixel], end = image_.offsets[pixel + 1];
    Pixel sum;
    Ends ends;
    if (!compositeTidy(begin, end, sum))
      compositeAny(pixel, begin, end, sum, ends);
    else if (findEnds_)
      findEnds(begin, end, ends);
    PixelDepths& depths = row_.depths[pixel - firstPixel];
    row_.alpha[pixel - firstPixel] = sum.alpha;
    if (begin == end)
      depths = {};
    else if (sum.depthAlpha > 0)
      depths = {float(sum.depth / sum.depthAlpha), ends.front, ends.back, std::min(ends.passing, ends.back)};
    else
      depths = {sum.nearest, sum.nearest, sum.nearest, sum.nearest};
  }
  return row_;
}

}  // namespace fathom::deep
