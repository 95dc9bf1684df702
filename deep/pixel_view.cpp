// The usual pixel, whose parts go from front to back and do not meet, takes one pass over its samples and one over its
// parts; any other goes through PixelPieces.
#include "deep/pixel_view.h"

#include <algorithm>
#include <cmath>

#include "deep/channels.h"
#include "flat/finite.h"

namespace fathom::deep {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Puts parts down from the first one on. Its pointers stay in registers.
struct Writer {
  size_t* sample;
  float *z, *zBack, *alpha, *weight;
  size_t count = 0;

  explicit Writer(PixelParts& to)
      : sample(to.sample.data()),
        z(to.z.data()),
        zBack(to.zBack.data()),
        alpha(to.alpha.data()),
        weight(to.weight.data()) {}
  void add(size_t of, const Range& range, float alphaHere, float weightHere) {
    sample[count] = of;
    z[count] = range.z;
    zBack[count] = range.zBack;
    alpha[count] = alphaHere;
    weight[count] = weightHere;
    ++count;
  }
};

}  // namespace

void MeanDepths::put(const Range& range, double seen) {
  if (range.z < nearest_.z) nearest_ = range;
  if (!std::isfinite(range.z)) return;
  middle_ += seen * range.middle();
  back_ += seen * double(range.zBack);
  alpha_ += seen;
}

PixelView::PixelView(const DeepImage& image, const DepthRange& range)
    : image_(image), cut_(range), alpha_(image.get("A")), samples_(image), mergePoints_(!holdsStatistics(image)) {}

// A sample has two parts at most.
void PixelView::makeRoom(size_t samples) {
  if (2 * samples <= parts_.sample.size()) return;
  parts_.sample.resize(2 * samples);
  for (auto* values : {&parts_.z, &parts_.zBack, &parts_.alpha, &parts_.weight}) values->resize(2 * samples);
  for (auto* values : {&parts_.factor, &parts_.seen}) values->resize(2 * samples);
}

bool PixelView::set(size_t pixel) {
  const uint64_t begin = image_.offsets[pixel], end = image_.offsets[pixel + 1];
  const float *const z = samples_.z.data(), *const zBack = samples_.zBack.data(), *const alphas = alpha_.data();
  const bool mergePoints = mergePoints_;
  const RangeCut cut = cut_;
  makeRoom(end - begin);
  Writer to(parts_);
  bool tidy = true;
  float before = -kInfinity, behind = -kInfinity;  // where the last part began and ended
  const auto add = [&](size_t i, const Range& range, float alpha, float weight) {
    tidy &= !((range.z < behind) | (mergePoints & (range.zBack == before)));
    before = range.z;
    behind = range.zBack;
    to.add(i, range, alpha, weight);
  };
  for (size_t i = begin; i < end; ++i) {
    const Range range = usableRange(z[i], zBack[i]);
    if (cut.leavesNothing(range)) continue;
    if (cut.leavesWhole(range)) {
      add(i, range, float(opacity(alphas[i])), 1);
      continue;
    }
    std::array<Fragment, 2> room;
    for (const Fragment& part : cut_.cut(range, opacity(alphas[i]), room))
      add(i, part.range, float(part.alpha), float(part.weight));
  }
  parts_.count = to.count;
  pixel_ = pixel;
  tidy_ = tidy;
  return tidy;
}

double PixelView::compositeTidy(const Values& values, Totals& totals) const {
  const size_t *const samples = parts_.sample.data(), count = parts_.count;
  const float *const alphas = parts_.alpha.data(), *const weights = parts_.weight.data();
  Sums sums;
  Totals sum = {};
  for (size_t i = 0; i < count; ++i) {
    const double factor = sums.put(double(alphas[i])) * double(weights[i]);
    for (size_t c = 0; c < kTogether; ++c) sum[c] += factor * double(finiteOrZero(values[c][samples[i]]));
  }
  totals = sum;
  return sums.alpha;
}

void PixelView::weighTidy() {
  for (size_t i = 0; i < parts_.count; ++i) {
    const double alpha = double(parts_.alpha[i]), front = sums_.put(alpha);
    parts_.factor[i] = front * double(parts_.weight[i]);
    parts_.seen[i] = front * alpha;
    depths_.put({parts_.z[i], parts_.zBack[i]}, front * alpha);
  }
}

void PixelView::weighAny() {
  const size_t count = parts_.count;
  std::fill_n(parts_.factor.begin(), count, 0.0);
  std::fill_n(parts_.seen.begin(), count, 0.0);
  pieces_.set({parts_.z.data(), count}, {parts_.zBack.data(), count});
  pieces_.checkOverlaps(mergePoints_, image_.dataWindow, pixel_);
  pieces_.visit({parts_.alpha.data(), count}, mergePoints_, [&](const Piece& piece) {
    const double front = sums_.put(piece.alpha), seen = front * piece.alpha;
    depths_.put(piece.range, seen);
    for (const Share& share : piece.shares) {
      parts_.factor[share.sample] += front * share.weight * double(parts_.weight[share.sample]);
      parts_.seen[share.sample] += seen * share.part;
    }
  });
}

void PixelView::composite() {
  sums_ = {};
  depths_ = {};
  if (tidy_)
    weighTidy();
  else
    weighAny();
}

}  // namespace fathom::deep
