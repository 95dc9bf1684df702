// The tidy form of one deep pixel: how its samples are cut and which of them meet in each piece.
//
// Source: "Interpreting OpenEXR Deep Pixels". Volumes are cut at every Z and ZBack strictly inside them; what then
// covers the same depths is merged (never a point with a volume); pieces follow each other by (Z, ZBack) and do not
// overlap.
#pragma once

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
  Piece meet(std::span<const size_t> samples, Range range, std::span<const float> alpha);

  std::vector<Range> ranges_;
  std::vector<size_t> order_;
  Untidiness untidiness_;
  std::vector<float> cuts_;  // every Z and ZBack, once
  std::vector<size_t> active_;
  std::vector<double> alphas_, weights_, parts_;
  std::vector<Share> shares_;
};

// The same for a size that is known.
void checkOverlaps(PixelPieces::Size size, const Box& dataWindow, size_t pixel);

template <class Visit>
void PixelPieces::visit(std::span<const float> alpha, bool mergePoints, const Visit& visit) {
  if (!untidiness_.any()) {
    for (const size_t& sample : order_) visit(meet({&sample, 1}, ranges_[sample], alpha));
    return;
  }
  findCuts();
  active_.clear();
  size_t next = 0;
  const auto startsAt = [&](float z) { return next < order_.size() && ranges_[order_[next]].z == z; };
  for (size_t k = 0; k < cuts_.size(); ++k) {
    const float z = cuts_[k];
    std::erase_if(active_, [&](size_t sample) { return ranges_[sample].zBack <= z; });
    const size_t first = next;
    while (startsAt(z) && ranges_[order_[next]].isPoint()) ++next;
    const std::span<const size_t> points = order().subspan(first, next - first);
    if (mergePoints && !points.empty()) visit(meet(points, {z, z}, alpha));
    for (size_t i = 0; !mergePoints && i < points.size(); ++i) visit(meet(points.subspan(i, 1), {z, z}, alpha));
    while (startsAt(z)) active_.push_back(order_[next++]);
    if (!active_.empty()) visit(meet(active_, {z, cuts_[k + 1]}, alpha));
  }
}

}  // namespace fathom::deep
