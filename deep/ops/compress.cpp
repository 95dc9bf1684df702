// Per pixel: its pieces make the curves, the curves tell which pieces go together.
#include "deep/ops/compress.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "deep/channels.h"
#include "deep/ops/pixel_curve.h"
#include "deep/ops/sample_plan.h"
#include "deep/pixel_pieces.h"
#include "deep/tidy.h"

namespace fathom::deep {

namespace {

struct Source {
  const DeepImage& image;
  std::span<const float> alpha, z, zBack;
  std::array<std::span<const float>, 3> colours;  // empty where missing
  bool mergePoints;
  double error;

  explicit Source(const DeepImage& from, bool merge, double bound)
      : image(from),
        alpha(from.get("A")),
        z(from.get("Z")),
        zBack(from.tryGet("ZBack")),
        mergePoints(merge),
        error(bound) {
    for (size_t c = 0; c < 3; ++c) {
      const std::string name(1, "RGB"[c]);
      if (from.find(name)) colours[c] = from.get(name);
    }
  }
};

struct Part {
  uint64_t sample;
  double weight, part;  // as in Share
};

// One pixel after the other; its scratch is allocated once.
class PixelCompression {
 public:
  explicit PixelCompression(const Source& source) : source_(source) {}

  void run(size_t pixel, RowPlan& row) {
    load(pixel);
    measure();
    row.nextPixel();
    for (size_t begin = 0; begin < curve_.steps.size();) {
      const Fit fit = longestFit(curve_, begin, !source_.zBack.empty());
      write(begin, fit, row);
      begin = fit.end;
    }
  }

 private:
  void load(size_t pixel) {
    const size_t first = source_.image.offsets[pixel], count = source_.image.count(pixel);
    pieces_.set(source_.z.subspan(first, count),
                source_.zBack.empty() ? source_.zBack : source_.zBack.subspan(first, count));
    pieces_.checkOverlaps(source_.mergePoints, source_.image.dataWindow, pixel);
    curve_.steps.clear();
    curve_.points.assign(1, {1, 0, 0, 0});
    parts_.clear();
    begins_.assign(1, 0);
    alphas_.clear();
    pieces_.visit(source_.alpha.subspan(first, count), source_.mergePoints,
                  [&](const Piece& piece) { add(piece, first); });
  }

  // Points at the same depth that are not merged are one step: nothing is between them.
  void add(const Piece& piece, size_t first) {
    const bool joins = !curve_.steps.empty() && piece.range.isPoint() && curve_.steps.back().range == piece.range;
    const double alpha = float(piece.alpha) == 1 ? 1 : piece.alpha, before = joins ? 1 - alphas_.back() : 1;
    if (!joins) {
      curve_.steps.push_back({piece.range, 0});
      curve_.points.push_back(curve_.points.back());
      begins_.push_back(begins_.back());
      alphas_.push_back(0);
    }
    CurvePoint& behind = curve_.points.back();
    for (const Share& share : piece.shares) {
      const size_t sample = first + share.sample;
      for (size_t c = 0; c < 3; ++c)
        if (!source_.colours[c].empty())
          behind[c + 1] += behind[0] * share.weight * double(finiteOrZero(source_.colours[c][sample]));
      parts_.push_back({sample, before * share.weight, before * alpha * share.part});
    }
    behind[0] *= 1 - alpha;
    curve_.steps.back().depth -= std::log1p(-alpha);
    alphas_.back() += before * alpha;
    begins_.back() = parts_.size();
  }

  // Brings the curves into units of the error.
  void measure() {
    double most = 0;
    for (const CurvePoint& point : curve_.points)
      for (size_t c = 1; c < 4; ++c) most = std::max(most, std::abs(point[c]));
    const double colour = most > 0 ? 1 / (source_.error * most) : 0;
    for (CurvePoint& point : curve_.points) {
      point[0] /= source_.error;
      for (size_t c = 1; c < 4; ++c) point[c] *= colour;
    }
  }

  bool isAsItWas(uint64_t sample, const Range& range) const {
    const float z = source_.z[sample], zBack = source_.zBack.empty() ? z : source_.zBack[sample];
    return z == range.z && zBack == range.zBack;
  }

  void write(size_t begin, const Fit& fit, RowPlan& row) {
    const std::span<const Part> parts =
        std::span<const Part>(parts_).subspan(begins_[begin], begins_[fit.end] - begins_[begin]);
    if (parts.size() == 1 && isAsItWas(parts[0].sample, fit.range)) return row.keep(parts[0].sample);
    shares_.clear();
    double passed = 1, alpha = 0;
    for (size_t k = begin; k < fit.end; ++k) {
      for (size_t i = begins_[k]; i < begins_[k + 1]; ++i)
        shares_.push_back({parts_[i].sample, float(passed * parts_[i].weight), float(passed * parts_[i].part)});
      alpha += passed * alphas_[k];
      passed *= 1 - alphas_[k];
    }
    for (RowPlan::Share& share : shares_)
      share.part = alpha > 0 ? float(double(share.part) / alpha) : 1 / float(shares_.size());
    row.mix(shares_, fit.range.z, fit.range.zBack, float(alpha));
  }

  const Source& source_;
  PixelPieces pieces_;
  PixelCurve curve_;
  std::vector<double> alphas_;  // of the steps
  std::vector<Part> parts_;     // of the steps, one after the other
  std::vector<size_t> begins_;  // first part of each step, and the end of the last
  std::vector<RowPlan::Share> shares_;
};

}  // namespace

DeepImage compress(DeepImage image, const CompressParams& params) {
  if (!(params.error > 0)) fail("error: expected a number above 0, found {}", params.error);
  const bool mergePoints = !holdsStatistics(image);
  dropSampleStatistics(image);
  const Source source(image, mergePoints, params.error);
  const size_t width = size_t(image.dataWindow.width());
  return mapRows(image, [&](int y, RowPlan& row) {
    PixelCompression compression(source);
    const size_t first = size_t(y - image.dataWindow.y0) * width;
    for (size_t pixel = first; pixel < first + width; ++pixel) compression.run(pixel, row);
  });
}

}  // namespace fathom::deep
