// Where the samples of an image lie in depth, with or without ZBack.
#pragma once

#include <span>

#include "deep/image.h"
#include "deep/volume.h"

namespace fathom::deep {

// Both spans by sample, as the file has them; without ZBack they are the same. The image must outlive it.
struct SampleDepths {
  std::span<const float> z, zBack;

  // Throws Error where Z is missing.
  explicit SampleDepths(const DeepImage& image) : z(image.get("Z")), zBack(image.tryGet("ZBack")) {
    if (zBack.empty()) zBack = z;
  }
  Range operator[](size_t sample) const { return usableRange(z[sample], zBack[sample]); }
  // Those of some samples that follow one another.
  std::span<const float> fronts(size_t first, size_t count) const { return z.subspan(first, count); }
  std::span<const float> backs(size_t first, size_t count) const { return zBack.subspan(first, count); }
};

}  // namespace fathom::deep
