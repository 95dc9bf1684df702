// What each sample of a row of pixels adds to which bin, decided before any channel but depth and alpha is looked at.
#pragma once

#include <cstdint>
#include <vector>

#include "deep/bin_layout.h"
#include "deep/image.h"

namespace fathom::deep {

struct ClusterPlan {
  static constexpr uint32_t kNoBin = UINT32_MAX;

  // Per sample of the row, in the image's order.
  std::vector<uint32_t> bin;   // counted from the row's first bin; kNoBin: its pixel has none
  std::vector<double> weight;  // in the bin's means of values that are not premultiplied
  std::vector<double>
      factor;  // of premultiplied values in the same means: weight / alpha; above 0 for what shines without alpha
  std::vector<uint8_t> half;  // 0 or 1
  // Per bin of the row.
  std::vector<uint32_t> count;  // samples
  std::vector<float> alpha, z, zBack;
};

// The channels that decide, and how their alphas are to be read. Throws Error when A or Z is missing.
struct SampleGeometry {
  const DeepImage& image;
  std::span<const float> alpha, z, zBack;
  int spp;           // attribute fathom:spp, or 0
  double tolerance;  // how far rounding may bring an effective alpha from 1/n

  explicit SampleGeometry(const DeepImage& samples);
  Range range(size_t i) const { return usableRange(z[i], zBack.empty() ? z[i] : zBack[i]); }
  float depth(size_t i) const { return binDepth(z[i], zBack.empty() ? z[i] : zBack[i]); }
};

ClusterPlan planRow(const SampleGeometry& samples, const BinLayout& layout, int y);

}  // namespace fathom::deep
