// What the deep pixels of a box have in common, in numbers.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "deep/statistics.h"

namespace fathom::deep {

// Of the samples that are the same number in their pixels, as they are stored. Means are over all pixels of the box.
struct BinStatistics {
  uint64_t pixels = 0;  // that have such a bin
  double depth = 0;   // mean over those at a finite depth, weighted by effective alpha; a volume stands for its middle
  double alpha = 0;   // mean effective alpha
  double energy = 0;  // mean Rec. 709 luminance that they add to their pixels
};

struct BoxStatistics {
  Box box;            // the part of it inside of the data window
  Statistics counts;  // pixels, samples, depths
  double alpha = 0;   // mean of the flattened pixels
  std::array<double, 3> colour = {};
  std::vector<BinStatistics> bins;  // energies add up to the luminance of `colour`
};

// `colour`: three premultiplied channels. Empty boxes and such outside of the image give zeros. The same bits for any
// number of threads. Throws Error where A, Z or a channel is missing, and where volumes overlap too much (see `tidy`).
BoxStatistics boxStatistics(const DeepImage& image, const Box& box,
                            const std::array<std::string, 3>& colour = {"R", "G", "B"});

}  // namespace fathom::deep
