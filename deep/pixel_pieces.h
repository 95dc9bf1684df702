// The tidy form of one deep pixel: how its samples are cut and which of them meet in each piece.
//
// Source: "Interpreting OpenEXR Deep Pixels". Volumes are cut at every Z and ZBack strictly inside them; what then
// covers the same depths is merged (never a point with a volume); pieces follow each other by (Z, ZBack) and do not
// overlap.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "deep/volume.h"
#include "flat/box.h"

namespace fathom::deep {

// How a pixel, or a whole image, differs from the tidy form.
struct Untidiness {
  bool unsorted = false;        // the order is not by (Z, ZBack), or a range had to be made usable
  bool pointsCoincide = false;  // points at the same depth
  bool volumesOverlap = false;  // a volume has another sample inside it, or covers the same depths as another volume

  bool any() const { return unsorted || pointsCoincide || volumesOverlap; }
  Untidiness& operator|=(const Untidiness& other);
};

// A sample's part in a piece; its number counts from the pixel's first sample.
struct Share {
  size_t sample;
  double weight;  // factor of its premultiplied values
  double part;    // of the piece's opacity; the parts of a piece sum to 1
};

struct Piece {
  Range range;
  double alpha;
  size_t largest;  // the sample with the largest part
  bool whole;      // one sample as it was
  std::span<const Share> shares;
};

// Holds one pixel at a time; meant to be used for one after the other, so that its scratch is allocated once.
class PixelPieces {
 public:
  // Takes the samples of a pixel; `zBack` may be empty, when all are points.
  void set(std::span<const float> z, std::span<const float> zBack);

  const Untidiness& untidiness() const { return untidiness_; }
  // Sample numbers, front to back.
  std::span<const size_t> order() const { return order_; }

  // How many pieces there are, and how many shares they have together: that grows with the square of the overlapping
  // volumes.
  struct Size {
    size_t pieces = 0, shares = 0;
  };
  Size size(bool mergePoints);

  // Calls `visit` with one piece after the other, front to back. Points that coincide are one piece each unless
  // `mergePoints`.
  template <class Visit>
  void visit(std::span<const float> alpha, bool mergePoints, const Visit& visit);

  // Throws Error, with the pixel's place, when its shares are more than 100 million: more than is worth the time and
  // the memory.
  void checkOverlaps(bool mergePoints, const Box& dataWindow, size_t pixel);

 private:
  void findCuts();
  double opticalDepthOf(size_t sample);
  // Whether the i-th in order, which no sample before it reaches, shares its depths with the next one.
  bool meetsNext(size_t i, bool mergePoints) const {
    if (!untidiness_.any() || i + 1 == order_.size()) return false;
    const Range &range = ranges_[order_[i]], &next = ranges_[order_[i + 1]];
    return range.isPoint() ? mergePoints && next == range : next.z < range.zBack;
  }
  Piece alone(size_t sample);
  Piece meet(std::span<const size_t> samples, Range range);

  std::vector<Range> ranges_;
  std::vector<size_t> order_;
  Untidiness untidiness_;
  std::vector<float> cuts_;  // every Z and ZBack, once
  std::vector<size_t> active_;
  std::span<const float> alpha_;  // of the samples, while they are visited
  std::vector<double> depths_;    // their optical depths; NaN where not looked at yet; empty where none was
  std::vector<Slice> slices_;
  std::vector<double> weights_, parts_;
  std::vector<Share> shares_;
  Share alone_{};
};

// The same for a size that is known.
void checkOverlaps(PixelPieces::Size size, const Box& dataWindow, size_t pixel);

template <class Visit>
void PixelPieces::visit(std::span<const float> alpha, bool mergePoints, const Visit& visit) {
  alpha_ = alpha;
  depths_.clear();
  active_.clear();  // the volumes at `z`
  float z = 0;
  size_t next = 0;
  const auto startsHere = [&] { return next < order_.size() && ranges_[order_[next]].z == z; };
  while (next < order_.size() || !active_.empty()) {
    if (active_.empty()) {
      if (!meetsNext(next, mergePoints)) {
        visit(alone(order_[next++]));
        continue;
      }
      z = ranges_[order_[next]].z;
    }
    const size_t first = next;
    while (startsHere() && ranges_[order_[next]].isPoint()) ++next;
    const std::span<const size_t> points = order().subspan(first, next - first);
    if (mergePoints && points.size() > 1)
      visit(meet(points, {z, z}));
    else
      for (const size_t point : points) visit(alone(point));
    while (startsHere()) active_.push_back(order_[next++]);
    if (active_.empty()) continue;
    float end = ranges_[active_[0]].zBack;
    for (const size_t volume : active_) end = std::min(end, ranges_[volume].zBack);
    if (next < order_.size()) end = std::min(end, ranges_[order_[next]].z);
    visit(meet(active_, {z, end}));
    z = end;
    std::erase_if(active_, [&](size_t sample) { return ranges_[sample].zBack <= z; });
  }
}

}  // namespace fathom::deep
