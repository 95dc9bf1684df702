// The tidy form of a deep image: samples sorted front to back, not overlapping, none at the depth of another.
#pragma once

#include <string>
#include <vector>

#include "deep/image.h"
#include "deep/pixel_pieces.h"

namespace fathom::deep {

// How the image differs from the tidy form, over all pixels; one pass. Needs channel Z only; ZBack where there are
// volumes.
Untidiness findUntidiness(const DeepImage& image);
inline bool isTidy(const DeepImage& image) {
  return !findUntidiness(image).any();
}

// Samples front to back by (Z, ZBack), equal ones in the order they had; values unchanged. A Z that is not a number
// goes last.
DeepImage sortSamples(DeepImage image);

// Removes the channels that are void once samples are merged or split (half buffers, variances, counts); returns their
// names.
std::vector<std::string> dropSampleStatistics(DeepImage& image);

struct TidyResult {
  DeepImage image;
  std::vector<std::string> dropped;  // see dropSampleStatistics; empty where no sample was merged or split
};

// Sorts, splits volumes that others overlap, and merges what then coincides: flattening gives the same. Samples that
// need neither are passed on bit for bit, and a tidy image whole. In the others, non-finite values count as 0 and sums end
// at 1e15, above which they would be no numbers; a merged
// sample takes the id of the one with the larger share, and the share-weighted mean of what is not premultiplied.
// Volumes whose alpha together rounds to 1 are opaque from their front on: that shows once something is put into them.
// Ranges that cannot be used (reversed, infinite, no number) become points, a Z that is no number becomes infinity.
// Throws Error when A or Z is missing, and when the volumes of one pixel overlap so much that their pieces would be
// more than 100 million.
// Points at the same depth stay one after the other in an image of camera samples or bins made of them (see
// holdsStatistics), as flatten composites them, unless its statistics are void because volumes overlap.
TidyResult tidy(DeepImage image);

}  // namespace fathom::deep
