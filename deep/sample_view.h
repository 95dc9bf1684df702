// Which samples of each pixel a range of depths leaves: how many there are, and which is seen most: that one shows
// identifiers, which cannot be composited.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "deep/depth_range.h"
#include "deep/image.h"

namespace fathom::deep {

inline constexpr uint64_t kNoSample = std::numeric_limits<uint64_t>::max();

// `box` and `step` choose pixels as clipView's do, and a pixel outside of the data window has no samples. Of a sample is
// left what RangeCut leaves.

// Per pixel the place, in the image's planes, of the sample with the largest effective alpha; of equal ones the nearest.
// kNoSample where none has alpha. Samples may lie in any order; those that overlap count as standing behind one another.
// Throws Error where A or Z is missing.
Buffer<uint64_t> mostSeen(const DeepImage& image, const Box& box, int step, const DepthRange& range);

// How many samples of each pixel something is left of. Throws Error where Z is missing, but for the range that is all.
Buffer<uint32_t> countSamples(const DeepImage& image, const Box& box, int step, const DepthRange& range);

// Per pixel 1 where a sample of which something is left has a value that compositing takes for 0 (see finiteOrZero) in
// one of `channels`, which must be there and not UINT. Throws Error where Z is missing.
Buffer<uint8_t> findNonFinite(const DeepImage& image, const Box& box, int step, const DepthRange& range,
                              const std::vector<std::string>& channels);

// Where the nearest sample with alpha of a pixel begins, of those at finite depths. Throws Error where A or Z is missing.
std::optional<float> nearestDepth(const DeepImage& image, int x, int y);

}  // namespace fathom::deep
