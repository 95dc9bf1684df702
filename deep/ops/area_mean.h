// The mean of several deep pixels as one deep pixel.
//
// Each pixel of a mean covers a part of it and hides nothing of the others, so alphas cannot be scaled by area: two
// halves that are opaque at different depths would let a quarter of the light through. What is averaged is what is seen
// of each sample: its effective alpha, its own alpha behind what stands before it in its own pixel. Front to back, a new
// sample gets the alpha (effective alpha of what it stands for) / (transmittance that is left). Flattening that gives
// the mean of the flattened pixels, at every depth at which a sample of the result ends.
#pragma once

#include <span>
#include <vector>

#include "deep/image.h"
#include "deep/ops/sample_plan.h"
#include "deep/volume.h"

namespace fathom::deep {

struct PixelShare {
  size_t pixel;
  double weight;  // of the area, > 0
};

// Holds one pixel at a time; meant to be used for one after the other, so that its scratch is allocated once.
class AreaMean {
 public:
  // `image` has A and Z; its samples are sorted and do not overlap (see tidy), points at the same depth may follow each
  // other. Depths within `tolerance`, relative to the first of them, become one sample: a point at their mean where
  // points make up most of it, else a volume over all of them. 0 merges only points at the same depth. The image must
  // outlive this.
  AreaMean(const DeepImage& image, double tolerance);

  // Adds the mean to the row, as its next pixel. The weights' sum is at most 1: the rest is empty. One pixel of weight 1
  // is copied, sample by sample. Otherwise volumes are cut at every depth where a sample of another pixel begins or
  // ends, and samples are left out that nothing is seen of since their own pixel is opaque before them. A sample whose
  // alpha is 0 still emits.
  void add(std::span<const PixelShare> pixels, RowPlan& row);

 private:
  // A sample of one of the pixels.
  struct Source {
    Range range;
    uint32_t pixel;  // which of them
    uint64_t sample;
  };
  struct Share {
    uint64_t sample;
    double light;  // what passes of it: area times transmittance, and what is left of a volume that was cut
    double seen;   // effective alpha
  };
  // What becomes one sample.
  struct Run {
    size_t firstShare;
    double light = 0, seen = 0, seenOfPoints = 0;  // sums
    double depth = 0;                              // of points, times what is seen of them
    double left = 0;                               // transmittance before it
    Range points, volumes;                         // from the first to the last
  };

  void gather(std::span<const PixelShare> pixels);
  void findDepths();
  size_t groupEnd(size_t first) const;
  void beginRun();
  void put(const Source& source, Range range);
  void putActive(float from, float to);
  void sweep();
  void emit(RowPlan& row);

  const DeepImage& image_;
  std::span<const float> alpha_, z_, zBack_;
  double tolerance_;
  std::vector<Source> sources_;   // front to back
  std::vector<float> depths_;     // where samples begin and end, each once
  std::vector<uint32_t> active_;  // volumes that reach behind the current depth
  std::vector<double> passing_;   // per pixel, its weight times its transmittance so far
  double empty_ = 0;              // weight of what is not covered
  std::vector<Run> runs_;
  std::vector<Share> shares_;
  std::vector<RowPlan::Share> mixed_;
};

}  // namespace fathom::deep
