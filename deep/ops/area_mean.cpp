// Volumes and points are visited in one sweep from the front; a run collects what becomes one sample. Within a pixel
// the order of its samples is kept, so that what is seen of each adds up to what flattening shows.
#include "deep/ops/area_mean.h"

#include <algorithm>
#include <limits>
#include <tuple>

namespace fathom::deep {

namespace {

// Less light than this is none; far below what a float holds.
constexpr double kNoLight = 1e-300;
// Weights whose sum is closer to 1 leave nothing empty.
constexpr double kRounding = 1e-12;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr Range kNowhere = {kInfinity, -kInfinity};

void extend(Range& range, const Range& by) {
  range = {std::min(range.z, by.z), std::max(range.zBack, by.zBack)};
}

}  // namespace

AreaMean::AreaMean(const DeepImage& image, double tolerance)
    : image_(image), alpha_(image.get("A")), z_(image.get("Z")), zBack_(image.tryGet("ZBack")), tolerance_(tolerance) {}

void AreaMean::gather(std::span<const PixelShare> pixels) {
  sources_.clear();
  passing_.clear();
  empty_ = 1;
  for (const PixelShare& share : pixels) {
    for (uint64_t s = image_.offsets[share.pixel]; s < image_.offsets[share.pixel + 1]; ++s)
      sources_.push_back({usableRange(z_[s], zBack_.empty() ? z_[s] : zBack_[s]), uint32_t(passing_.size()), s});
    passing_.push_back(share.weight);
    empty_ -= share.weight;
  }
  if (empty_ < kRounding) empty_ = 0;
  std::sort(sources_.begin(), sources_.end(), [](const Source& a, const Source& b) {
    return std::tie(a.range.z, a.range.zBack, a.pixel, a.sample) <
           std::tie(b.range.z, b.range.zBack, b.pixel, b.sample);
  });
}

void AreaMean::findDepths() {
  depths_.clear();
  bool volumes = false;
  for (const Source& source : sources_) {
    depths_.push_back(source.range.z);
    if (source.range.isPoint()) continue;
    depths_.push_back(source.range.zBack);
    volumes = true;
  }
  if (volumes) std::sort(depths_.begin(), depths_.end());
  depths_.erase(std::unique(depths_.begin(), depths_.end()), depths_.end());
}

// The last of the depths that become one with the first.
size_t AreaMean::groupEnd(size_t first) const {
  const double end = double(depths_[first]) + tolerance_ * std::abs(double(depths_[first]));
  size_t last = first;
  while (last + 1 < depths_.size() && double(depths_[last + 1]) <= end) ++last;
  return last;
}

void AreaMean::beginRun() {
  runs_.push_back({.firstShare = shares_.size(), .points = kNowhere, .volumes = kNowhere});
}

// Adds the part of a sample that lies in `range`.
void AreaMean::put(const Source& source, Range range) {
  double& passing = passing_[source.pixel];
  if (passing < kNoLight) return;
  const double alpha = opacity(alpha_[source.sample]);
  const double length = double(source.range.zBack) - double(source.range.z);
  const Part part =
      range == source.range ? Part{alpha, 1} : partOf(alpha, (double(range.zBack) - double(range.z)) / length);
  const double seen = passing * part.alpha;
  Run& run = runs_.back();
  shares_.push_back({source.sample, passing * part.weight, seen});
  run.light += passing * part.weight;
  run.seen += seen;
  if (range.isPoint()) {
    run.seenOfPoints += seen;
    run.depth += seen * double(range.z);
  }
  extend(range.isPoint() ? run.points : run.volumes, range);
  passing *= 1 - part.alpha;
}

void AreaMean::putActive(float from, float to) {
  for (const uint32_t i : active_) put(sources_[i], {from, std::min(to, sources_[i].range.zBack)});
  std::erase_if(active_, [&](uint32_t i) { return sources_[i].range.zBack <= to; });
}

// Runs take turns: one of all that begins or ends within the tolerance, and one of the volumes between that and what
// comes next.
void AreaMean::sweep() {
  runs_.clear();
  shares_.clear();
  active_.clear();
  uint32_t next = 0;
  for (size_t first = 0; first < depths_.size();) {
    const size_t last = groupEnd(first);
    const float from = depths_[first], to = depths_[last];
    beginRun();
    if (from < to) putActive(from, to);
    for (; next < sources_.size() && sources_[next].range.z <= to; ++next) {
      const Range& range = sources_[next].range;
      if (range.isPoint() || range.z < to) put(sources_[next], {range.z, std::min(range.zBack, to)});
      if (range.zBack > to) active_.push_back(next);
    }
    first = last + 1;
    if (active_.empty()) continue;
    beginRun();
    putActive(to, depths_[first]);
  }
}

void AreaMean::emit(RowPlan& row) {
  double left = empty_;
  for (const double passing : passing_) left += passing;
  for (size_t r = runs_.size(); r-- > 0;) left = runs_[r].left = left + runs_[r].seen;
  for (size_t r = 0; r < runs_.size(); ++r) {
    const Run& run = runs_[r];
    const size_t end = r + 1 < runs_.size() ? runs_[r + 1].firstShare : shares_.size();
    if (run.firstShare == end) continue;
    mixed_.clear();
    for (size_t i = run.firstShare; i < end; ++i) {
      const double part = run.seen > 0 ? shares_[i].seen / run.seen : shares_[i].light / run.light;
      mixed_.push_back({shares_[i].sample, float(shares_[i].light / run.left), float(part)});
    }
    const bool point = run.points.z <= run.points.zBack && 2 * run.seenOfPoints >= run.seen;
    Range range = run.points;
    if (!point) {
      extend(range, run.volumes);
    } else if (!range.isPoint() && run.seenOfPoints > 0) {
      range.z = std::clamp(float(run.depth / run.seenOfPoints), range.z, range.zBack);
    }
    row.mix(mixed_, range.z, point ? range.z : range.zBack, float(run.seen / run.left));
  }
}

void AreaMean::add(std::span<const PixelShare> pixels, RowPlan& row) {
  row.nextPixel();
  if (pixels.size() == 1 && pixels[0].weight == 1) {
    const size_t pixel = pixels[0].pixel;
    for (uint64_t s = image_.offsets[pixel]; s < image_.offsets[pixel + 1]; ++s) row.keep(s);
    return;
  }
  gather(pixels);
  findDepths();
  sweep();
  emit(row);
}

}  // namespace fathom::deep
