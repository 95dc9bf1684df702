// Neighbours form a list; a heap holds what it costs to unite each with the next. Entries of neighbours that have
// changed since are skipped when they come up.
#include "deep/ops/limit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

#include "base/error.h"
#include "deep/channels.h"
#include "deep/ops/sample_plan.h"
#include "deep/pixel_pieces.h"
#include "deep/tidy.h"

namespace fathom::deep {

namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// A tidy piece of the pixel; its shares lie in the pixel's list of shares.
struct Part {
  Range range;
  double alpha;
  bool whole;
  size_t firstShare;
};

// Consecutive parts that become one sample.
struct Union {
  uint32_t first, end;  // parts
  uint32_t before, next;
  uint32_t version = 0;  // how often it has grown; kNone: it is part of another
  double mass;           // what is seen of it
  double depth;          // where, on the average
};

// To unite a union with its next one.
struct Candidate {
  double cost;
  uint32_t front, frontVersion, backVersion;

  bool operator<(const Candidate& other) const {
    return std::tie(other.cost, other.front) < std::tie(cost, front);  // the cheapest on top of the heap
  }
};

class Limiter {
 public:
  Limiter(const DeepImage& image, bool mergePoints)
      : image_(image),
        alpha_(image.get("A")),
        z_(image.get("Z")),
        zBack_(image.tryGet("ZBack")),
        mergePoints_(mergePoints),
        colours_{image.tryGet("R"), image.tryGet("G"), image.tryGet("B")} {}

  void add(size_t pixel, size_t most, RowPlan& row) {
    row.nextPixel();
    first_ = image_.offsets[pixel];
    const size_t count = image_.count(pixel);
    if (count <= most) {
      for (size_t i = 0; i < count; ++i) row.keep(first_ + i);
      return;
    }
    takeApart(pixel, count);
    begin();
    for (size_t left = parts_.size(); left > most; --left) uniteCheapest();
    for (uint32_t u = 0; u != kNone && !parts_.empty(); u = unions_[u].next) emit(unions_[u], row);
  }

 private:
  void takeApart(size_t pixel, size_t count);
  double colourOf(size_t part) const;
  std::span<const Share> sharesOf(size_t part) const;
  void begin();
  void propose(uint32_t front);
  void uniteCheapest();
  void emit(const Union& of, RowPlan& row);
  Range rangeOf(const Union& of, double seen) const;

  const DeepImage& image_;
  std::span<const float> alpha_, z_, zBack_;
  bool mergePoints_;
  std::array<std::span<const float>, 3> colours_;
  size_t first_ = 0;  // the pixel's first sample
  PixelPieces pieces_;
  std::vector<Part> parts_;
  std::vector<Share> shares_;
  std::vector<Union> unions_;
  std::vector<Candidate> heap_;
  std::vector<RowPlan::Share> mixed_;
  std::vector<double> seen_;  // per part of a union, its effective alpha within it
};

void Limiter::takeApart(size_t pixel, size_t count) {
  parts_.clear();
  shares_.clear();
  pieces_.set(z_.subspan(first_, count), zBack_.empty() ? zBack_ : zBack_.subspan(first_, count));
  pieces_.checkOverlaps(mergePoints_, image_.dataWindow, pixel);
  pieces_.visit(alpha_.subspan(first_, count), mergePoints_, [&](const Piece& piece) {
    parts_.push_back({piece.range, piece.alpha, piece.whole, shares_.size()});
    shares_.insert(shares_.end(), piece.shares.begin(), piece.shares.end());
  });
}

std::span<const Share> Limiter::sharesOf(size_t part) const {
  const size_t begin = parts_[part].firstShare;
  const size_t end = part + 1 < parts_.size() ? parts_[part + 1].firstShare : shares_.size();
  return {shares_.data() + begin, end - begin};
}

// The mean magnitude of the colours.
double Limiter::colourOf(size_t part) const {
  double sum = 0;
  for (const Share& share : sharesOf(part))
    for (const std::span<const float> values : colours_)
      if (!values.empty()) sum += std::abs(share.weight * double(finiteOrZero(values[first_ + share.sample])));
  return sum / double(colours_.size());
}

void Limiter::begin() {
  unions_.clear();
  heap_.clear();
  double passing = 1;
  const auto parts = uint32_t(parts_.size());
  for (uint32_t i = 0; i < parts; ++i) {
    unions_.push_back({.first = i,
                       .end = i + 1,
                       .before = i == 0 ? kNone : i - 1,
                       .next = i + 1 < parts ? i + 1 : kNone,
                       .mass = passing * (parts_[i].alpha + colourOf(i)),
                       .depth = parts_[i].range.middle()});
    passing *= 1 - parts_[i].alpha;
  }
  for (uint32_t i = 0; i + 1 < parts; ++i) propose(i);
}

// The area between what is seen up to each depth before and after, relative to the depth.
void Limiter::propose(uint32_t front) {
  const Union &a = unions_[front], &b = unions_[a.next];
  const double mass = a.mass + b.mass;
  double cost = 0;
  if (mass > 0 && a.depth != b.depth) {
    const double distance = (b.depth - a.depth) / std::max(std::abs(a.depth), std::abs(b.depth));
    cost = a.mass * b.mass / mass * (std::isfinite(distance) ? distance : 2);
  }
  heap_.push_back({cost, front, a.version, b.version});
  std::push_heap(heap_.begin(), heap_.end());
}

void Limiter::uniteCheapest() {
  const auto isCurrent = [&](const Candidate& of) {
    const Union& front = unions_[of.front];
    return front.version == of.frontVersion && front.next != kNone && unions_[front.next].version == of.backVersion;
  };
  const auto take = [&] {
    std::pop_heap(heap_.begin(), heap_.end());
    const Candidate top = heap_.back();
    heap_.pop_back();
    return top;
  };
  Candidate cheapest = take();
  while (!isCurrent(cheapest)) cheapest = take();
  const uint32_t u = cheapest.front;
  Union &front = unions_[u], &back = unions_[front.next];
  const double mass = front.mass + back.mass;
  if (front.depth != back.depth) {
    const double share = mass > 0 ? back.mass / mass : 0.5;
    front.depth = share == 0 ? front.depth : share == 1 ? back.depth : front.depth + share * (back.depth - front.depth);
  }
  front.mass = mass;
  front.end = back.end;
  front.next = back.next;
  ++front.version;
  back.version = kNone;
  if (front.next != kNone) {
    unions_[front.next].before = u;
    propose(u);
  }
  if (front.before != kNone) propose(front.before);
}

// `seen`: of all parts together. What lies at an infinite depth has no say where others do.
Range Limiter::rangeOf(const Union& of, double seen) const {
  const Range none = {std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};
  Range points = none, all = none;
  double seenOfPoints = 0, depth = 0;
  bool volumes = false;
  for (uint32_t i = of.first; i < of.end; ++i) {
    const Range& range = parts_[i].range;
    if (!std::isfinite(range.z)) continue;
    all = {std::min(all.z, range.z), std::max(all.zBack, range.zBack)};
    volumes |= !range.isPoint();
    if (!range.isPoint()) continue;
    points = {std::min(points.z, range.z), std::max(points.zBack, range.z)};
    seenOfPoints += seen_[i - of.first];
    depth += seen_[i - of.first] * double(range.z);
  }
  if (all == none) return parts_[of.first].range;
  if (points == none || (volumes && 2 * seenOfPoints < seen)) return all;
  if (points.isPoint() || seenOfPoints == 0) return {points.z, points.z};
  const float mean = std::clamp(float(depth / seenOfPoints), points.z, points.zBack);
  return {mean, mean};
}

void Limiter::emit(const Union& of, RowPlan& row) {
  if (of.end - of.first == 1 && parts_[of.first].whole)
    return row.keep(first_ + shares_[parts_[of.first].firstShare].sample);
  mixed_.clear();
  seen_.clear();
  double passing = 1, seen = 0;
  for (uint32_t i = of.first; i < of.end; ++i) {
    seen_.push_back(passing * parts_[i].alpha);
    seen += seen_.back();
    passing *= 1 - parts_[i].alpha;
  }
  passing = 1;
  for (uint32_t i = of.first; i < of.end; ++i) {
    const double part = seen > 0 ? seen_[i - of.first] / seen : 1.0 / (of.end - of.first);
    for (const Share& share : sharesOf(i))
      mixed_.push_back({first_ + share.sample, float(passing * share.weight), float(part * share.part)});
    passing *= 1 - parts_[i].alpha;
  }
  const Range range = rangeOf(of, seen);
  row.mix(mixed_, range.z, range.zBack, float(std::min(1.0, seen)));
}

}  // namespace

DeepImage limit(DeepImage image, int most) {
  if (most < 1) fail("limit: expected at least 1 sample, found {}", most);
  const bool mergePoints = !holdsStatistics(image);
  dropSampleStatistics(image);
  image.attributes.erase("deepImageState");
  const size_t width = size_t(image.dataWindow.width());
  return mapRows(image, [&](int y, RowPlan& row) {
    Limiter limiter(image, mergePoints);
    const size_t begin = size_t(y - image.dataWindow.y0) * width;
    for (size_t pixel = begin; pixel < begin + width; ++pixel) limiter.add(pixel, size_t(most), row);
  });
}

}  // namespace fathom::deep
