// What a deep image holds, channel by channel: gathered band by band, so that a frame of any size passes.
#pragma once

#include <string>
#include <vector>

#include "deep/image.h"
#include "deep/statistics.h"

namespace fathom::deep {

// The values of one channel over all samples.
struct ChannelStats {
  std::string name;
  PixelType type = PixelType::Float;
  uint64_t nans = 0, infinities = 0, negatives = 0;  // -inf is an infinity and not negative
  uint64_t finite = 0;                               // all others
  double least = 0, largest = 0, sum = 0;            // of the finite ones; 0 without any. Of ids no sum
  double mean() const { return finite > 0 ? sum / double(finite) : 0; }
};

struct ImageStats {
  Statistics samples;  // counts, depths
  std::vector<ChannelStats> channels;
  // Samples whose alpha is 0, 1 or more, and less than 0, more than 1 or not a number.
  uint64_t clear = 0, opaque = 0, badAlphas = 0;
  // Pixels that differ from the tidy form (see Untidiness), by how; `untidy` in any way.
  uint64_t unsorted = 0, pointsCoincide = 0, volumesOverlap = 0, untidy = 0;
  uint64_t bytes = 0;  // decoded, in memory

  // The next band of rows, with the channels of the bands before; bands from the top give the same bits whatever their
  // height. Channels A and Z may be missing.
  void add(const DeepImage& band);
};

}  // namespace fathom::deep
