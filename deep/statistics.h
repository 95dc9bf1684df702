// What is in a deep image, in numbers: gathered band by band, so that a frame of any size passes.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>

#include "deep/image.h"

namespace fathom::deep {

struct Statistics {
  uint64_t pixels = 0, samples = 0;
  uint64_t mostSamples = 0;  // in a pixel
  int mostX = 0, mostY = 0;  // the first such pixel
  // Pixels by their number of samples: 0, 1, 2, 3-4, 5-8, 9-16 and so on; kBuckets - 1 takes the rest.
  static constexpr size_t kBuckets = 18;
  std::array<uint64_t, kBuckets> histogram = {};

  // Of finite depths; nearest > farthest where there are none. ZBack counts where it is behind Z.
  float nearest = std::numeric_limits<float>::infinity();
  float farthest = -std::numeric_limits<float>::infinity();
  uint64_t volumes = 0;         // samples with ZBack > Z
  uint64_t badDepths = 0;       // samples whose Z or ZBack is not finite
  uint64_t unsortedPixels = 0;  // whose samples do not go from front to back

  static std::string bucketName(size_t bucket);
  // The channels Z and ZBack are looked at where the band has them.
  void add(const DeepImage& band) { add(band, band.dataWindow); }
  // The pixels of `box` alone, which lies inside of the data window.
  void add(const DeepImage& image, const Box& box);

 private:
  void addDepths(uint64_t begin, uint64_t end, std::span<const float> z, std::span<const float> back);
};

}  // namespace fathom::deep
