#include "deep/ops/sample.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "deep/channels.h"
#include "deep/pixel_pieces.h"
#include "deep/sample_depths.h"

namespace fathom::deep {

namespace {

size_t pixelAt(const Box& window, int x, int y) {
  if (!window.contains(x, y))
    fail("pixel ({}, {}): expected one of the data window, {} x {} at {} {}", x, y, window.width(), window.height(),
         window.x0, window.y0);
  return window.index(x, y);
}

}  // namespace

std::vector<SampleLight> lightOf(const DeepImage& image, int x, int y) {
  const Box& window = image.dataWindow;
  const size_t pixel = pixelAt(window, x, y), first = size_t(image.offsets[pixel]), count = image.count(pixel);
  const SampleDepths depths(image);
  const bool mergePoints = !holdsStatistics(image);
  PixelPieces pieces;
  pieces.set(depths.fronts(first, count), depths.backs(first, count));
  pieces.checkOverlaps(mergePoints, window, pixel);
  std::vector<SampleLight> light(count);
  std::vector<bool> begun(count);
  double passed = 1;
  pieces.visit(image.get("A").subspan(first, count), mergePoints, [&](const Piece& piece) {
    for (const Share& share : piece.shares) {
      SampleLight& sample = light[share.sample];
      if (!begun[share.sample]) sample.front = passed;
      begun[share.sample] = true;
      sample.seen += passed * piece.alpha * share.part;
    }
    passed *= 1 - piece.alpha;
  });
  return light;
}

// Whatever overlaps whatever: optical depths of merged samples add up. `behind` gathers, at the first depth behind a
// sample, what all depths from there on have in front of them.
std::vector<double> passingTo(const DeepImage& image, int x, int y, std::span<const float> depths) {
  const size_t pixel = pixelAt(image.dataWindow, x, y);
  const std::span<const float> alpha = image.get("A");
  const SampleDepths ranges(image);
  std::vector<double> passing(depths.size(), 0), behind(depths.size() + 1, 0);  // optical depths at first
  for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i) {
    const Range range = ranges[i];
    const double depth = opticalDepth(opacity(alpha[i])), length = double(range.zBack) - double(range.z);
    const size_t begin = size_t(std::ranges::upper_bound(depths, range.z) - depths.begin());
    const size_t end = std::max(begin, size_t(std::ranges::lower_bound(depths, range.zBack) - depths.begin()));
    for (size_t d = begin; d < end; ++d) passing[d] += depth * ((double(depths[d]) - double(range.z)) / length);
    behind[end] += depth;
  }
  double sum = 0;
  for (size_t d = 0; d < depths.size(); ++d) passing[d] = std::exp(-(passing[d] + (sum += behind[d])));
  return passing;
}

}  // namespace fathom::deep
