#include "deep/ops/sample.h"

#include <cmath>

#include "deep/channels.h"
#include "deep/pixel_pieces.h"
#include "flat/error.h"

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
  const std::span<const float> zBack = image.tryGet("ZBack");
  const bool mergePoints = !holdsStatistics(image);
  PixelPieces pieces;
  pieces.set(image.get("Z").subspan(first, count), zBack.empty() ? zBack : zBack.subspan(first, count));
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

// Whatever overlaps whatever: optical depths of merged samples add up.
std::vector<double> passingTo(const DeepImage& image, int x, int y, std::span<const float> depths) {
  const size_t pixel = pixelAt(image.dataWindow, x, y);
  const std::span<const float> alpha = image.get("A"), z = image.get("Z"), zBack = image.tryGet("ZBack");
  std::vector<double> passing(depths.size(), 0);  // optical depths at first
  for (size_t i = image.offsets[pixel]; i < image.offsets[pixel + 1]; ++i) {
    const Range range = usableRange(z[i], zBack.empty() ? z[i] : zBack[i]);
    const double depth = opticalDepth(opacity(alpha[i])), length = double(range.zBack) - double(range.z);
    for (size_t d = 0; d < depths.size(); ++d)
      if (depths[d] > range.z)
        passing[d] += depths[d] >= range.zBack ? depth : depth * ((double(depths[d]) - double(range.z)) / length);
  }
  for (double& value : passing) value = std::exp(-value);
  return passing;
}

}  // namespace fathom::deep
